// Directions from uniform numbers. Integers in, so that a turn's quadrant is exact; polynomials instead of sin and
// cos, so that drivers' own versions of these make no difference between backends.

// (cos, sin, 0) of 2π·(turn/2³² − 1/8): the eighth of a turn centres the polynomials on 0.
// Taylor to a⁸ and a⁹ on ±π/4: below 1e-8, a sixth of an ulp of 1.
INLINE Vec3 unit_circle(Uint turn) {
    Uint quadrant = turn >> 30u;
    Real a = (unit_real(turn << 2u) - 0.5f) * 1.57079633f;
    Real a2 = a * a;
    Real sine = a * (1.0f + a2 * (-0.166666667f + a2 * (8.33333333e-3f + a2 * (-1.98412698e-4f + a2 * 2.75573192e-6f))));
    Real cosine = 1.0f + a2 * (-0.5f + a2 * (4.16666667e-2f + a2 * (-1.38888889e-3f + a2 * 2.48015873e-5f)));
    Bool odd = (quadrant & 1u) != 0u;
    Real x = pick(odd, 0.0f - sine, cosine);
    Real y = pick(odd, cosine, sine);
    Bool half_turn = quadrant >= 2u;
    return make3(pick(half_turn, 0.0f - x, x), pick(half_turn, 0.0f - y, y), lanes(0.0f));
}

// Unit vector at height z (equal areas of the sphere are equal ranges of z: Archimedes) and a turn about the y axis.
INLINE Vec3 sphere_at(Real height, Uint turn) {
    Vec3 around = unit_circle(turn);
    Real radius = sqrt(max(1.0f - height * height, lanes(0.0f)));
    return make3(radius * around.x, height, radius * around.y);
}

// Unit vector, uniform over the sphere.
INLINE Vec3 sample_sphere(Uint height, Uint turn) { return sphere_at(1.0f - 2.0f * unit_real(height), turn); }

// Unit vector about `normal` with density cosθ/π: the normal plus a uniform point of the unit sphere, which needs no
// tangents.
INLINE Vec3 sample_cosine(Vec3 normal, Uint height, Uint turn) {
    Vec3 d = add3(normal, sample_sphere(height, turn));
    Real length2 = dot3(d, d);
    // A short sum is rounding more than direction: it may point into the surface, and opposite the pole, once in 2²⁴
    // draws, it vanishes. Its part along the normal is half its squared length, though, and that is known well.
    Bool grazing = length2 < 1.0e-5f;
    if (any_lane(grazing)) {
        Real lift = 0.5f * max(length2, lanes(1.0e-10f)) - dot3(d, normal);
        d = pick3(grazing, add3(d, scale3(normal, lift)), d);
        length2 = dot3(d, d);
    }
    return scale3(d, 1.0f / sqrt(length2));
}

#ifdef HAS_GLOSSY
// An orthonormal basis around n without a branch: Duff et al., JCGT 2017. copysign, since sign(0) would be 0.
INLINE Vec3 tangent_to(Vec3 n) {
    Real sign_z = copysign(lanes(1.0f), n.z);
    Real a = -1.0f / (sign_z + n.z);
    return make3(1.0f + sign_z * n.x * n.x * a, sign_z * n.x * n.y * a, 0.0f - sign_z * n.x);
}

INLINE Vec3 bitangent_to(Vec3 n) {
    Real sign_z = copysign(lanes(1.0f), n.z);
    Real a = -1.0f / (sign_z + n.z);
    return make3(n.x * n.y * a, sign_z + n.y * n.y * a, 0.0f - n.y);
}

// Half vector of GGX facets as seen from `to_viewer`, by spherical caps: Dupuy & Benyoub, HPG 2023. α = 0 gives the
// normal itself, a perfect mirror. Reflecting about it has weight Smith G1 of the new direction (F = 1).
INLINE Vec3 sample_ggx(Vec3 normal, Vec3 to_viewer, Real alpha, Uint height, Uint turn) {
    Vec3 tangent = tangent_to(normal);
    Vec3 bitangent = bitangent_to(normal);
    Real x = dot3(to_viewer, tangent) * alpha;
    Real y = dot3(to_viewer, bitangent) * alpha;
    Real z = dot3(to_viewer, normal);
    Real length = sqrt(x * x + y * y + z * z);
    Real cap = z / length;
    Vec3 around = unit_circle(turn);
    Real h = 1.0f - unit_real(height) * (1.0f + cap);
    Real radius = sqrt(max(1.0f - h * h, lanes(0.0f)));
    // Stretched half vector, then unstretched.
    Real hx = (radius * around.x + x / length) * alpha;
    Real hy = (radius * around.y + y / length) * alpha;
    Real hz = max(h + cap, lanes(1.0e-7f));
    return normalize3(add3(add3(scale3(tangent, hx), scale3(bitangent, hy)), scale3(normal, hz)));
}

// Smith's G1 for GGX.
INLINE Real smith_g1(Real cosine, Real alpha) { return 2.0f * cosine * smith_v(cosine, alpha); }
#endif
