// Density kernels over the unit disc, and what is left of their integral where planes cut the disc.
// Silverman, "Density Estimation for Statistics and Data Analysis", 1986; cone: Jensen 2001, ch. 7.

#define TWO_PI_INV 0.159154943f

// K(0) for R = 1: with it, the kernel's integral over the unit disc is 1.
#if defined(KERNEL_CONSTANT)
#define KERNEL_PEAK (2.0f * TWO_PI_INV)
#elif defined(KERNEL_CONE) || defined(KERNEL_BIWEIGHT)
#define KERNEL_PEAK (6.0f * TWO_PI_INV)
#else
#define KERNEL_PEAK (4.0f * TWO_PI_INV)
#endif

// K/K(0) at squared distance d2, with 1/R². Zero outside. The peak is left to the caller: once a pixel, not a photon.
Real kernel_shape(Real d2, Real inverse_radius2) {
#if defined(KERNEL_CONSTANT)
    return pick(d2 * inverse_radius2 < 1.0f, lanes(1.0f), 0.0f);
#elif defined(KERNEL_CONE)
    return max(1.0f - sqrt(d2 * inverse_radius2), lanes(0.0f));
#else
    Real shape = max(multiply_add(d2, -inverse_radius2, lanes(1.0f)), lanes(0.0f));
#ifdef KERNEL_BIWEIGHT
    shape = shape * shape;
#endif
    return shape;
#endif
}

// 2π times the kernel's integral over the part of the disc beyond a chord at distance h, between the chord's foot and
// the ray from the centre through the chord's point at distance u from the foot; odd in u.
//
// In polar coordinates: ∫ g(h/cos ψ) dψ from 0 to atan(u/h), where g(r) = 2π·∫ K r' dr' from r to 1 is 1−r²,
// (1−r²)², 1−3r²+2r³ and (1−r²)³ for the four kernels; powers of the secant integrate to polynomials in u.
Real beyond_to(Real h, Real u) {
    Real angle = arctan2(u, h);
#if defined(KERNEL_CONSTANT)
    return angle - h * u;
#elif defined(KERNEL_CONE)
    Real r = sqrt(h * h + u * u);
    // asinh(u/h), odd in u; the bound only keeps h = 0 finite, where the factor h³ wins.
    Real rise = copysign(log((fabs(u) + r) / max(h, lanes(1e-9f))), u);
    return angle - 3.0f * h * u + h * u * r + h * h * h * rise;
#elif defined(KERNEL_BIWEIGHT)
    Real h2 = h * h;
    Real u2 = u * u;
    return angle - h * u * (3.0f - 3.0f * (h2 + u2 * (1.0f / 3.0f)) + h2 * h2 + u2 * (2.0f / 3.0f * h2 + 0.2f * u2));
#else
    return angle - h * u * (2.0f - h * h - u * u * (1.0f / 3.0f));
#endif
}

// Half the chord's length.
Real half_chord(Real h) { return sqrt(max(1.0f - h * h, lanes(0.0f))); }

// The kernel's integral over the part of the unit disc beyond a chord at distance h in [0, 1).
Real beyond_chord(Real h) { return 2.0f * TWO_PI_INV * beyond_to(h, half_chord(h)); }

// The same over the part that lies beyond both of two chords, whose directions enclose an angle of the given cosine.
// Exact: the part is split at the ray through the chords' crossing, and each half is bounded by one chord only.
Real beyond_both(Real a, Real b, Real cosine) {
    Real sine = sqrt(max(1.0f - cosine * cosine, lanes(0.0f)));
    // Signed distances of the crossing from each chord's foot, towards the other chord's direction.
    Real along_a = (b - a * cosine) / max(sine, lanes(1e-6f));
    Real along_b = (a - b * cosine) / max(sine, lanes(1e-6f));
    Real crossing = TWO_PI_INV * (beyond_to(a, half_chord(a)) - beyond_to(a, along_a) +
                                  beyond_to(b, half_chord(b)) - beyond_to(b, along_b));
    // Chords that do not cross inside the disc: either one part holds the other, or they are disjoint. Nested means
    // that the nearer chord's part reaches past both ends of the farther one's.
    Real near_chord = min(a, b);
    Real far_chord = max(a, b);
    Bool nested = far_chord * cosine - half_chord(far_chord) * sine >= near_chord;
    Real apart = pick(nested, beyond_chord(far_chord), 0.0f);
    return pick(a * a + along_a * along_a < 1.0f, crossing, apart);
}

#ifdef HAS_FOOTPRINTS
// 2π times the kernel's integral from distance r to the rim, along one direction: g of beyond_to.
Real beyond_radius(Real r) {
    r = min(max(r, lanes(0.0f)), lanes(1.0f));
    Real w = 1.0f - r * r;
#if defined(KERNEL_CONSTANT)
    return w;
#elif defined(KERNEL_CONE)
    return w - 2.0f * r * r * (1.0f - r);
#elif defined(KERNEL_BIWEIGHT)
    return w * w * w;
#else
    return w * w;
#endif
}

// The kernel's integral over what a circle of radius rho around a point at a distance > rho covers of the unit disc.
// In polar coordinates, with sin θ = (rho/distance) sin φ; the midpoint rule in φ converges fast on what is periodic.
Real covered_by_circle(Real distance, Real rho) {
    Real sum = lanes(0.0f);
    for (int k = 0; k < 8; k++) {
        float phi = (float_of(k) + 0.5f) * 0.19634954f; // π/16
        Real s = rho / distance * lanes(sin(phi));
        Real c = sqrt(max(1.0f - s * s, lanes(1e-12f)));
        Real half_length = rho * lanes(cos(phi));
        Real middle = distance * c;
        sum += (beyond_radius(middle - half_length) - beyond_radius(middle + half_length)) * (half_length / c);
    }
    return sum / distance * (2.0f * 0.19634954f * TWO_PI_INV);
}

// What sphere i, where it cuts the plane that the point lies on, covers of the disc.
Real footprint(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    Vec3 away = sub3(object_anchor_same(i), surface.position);
    Real radius = object_extent_same(i);
    Real height = dot3(away, surface.normal);
    Vec3 across = sub3(away, scale3(surface.normal, height));
    Real distance = sqrt(dot3(across, across)) * inverse_radius;
    Real rho = sqrt(max(radius * radius - height * height, lanes(0.0f))) * inverse_radius;
    Bool covers = surface.object >= SPHERE_COUNT && rho > 0.0f && distance > rho && distance - rho < 1.0f;
    if (!any_lane(covers)) return lanes(0.0f);
    return pick(covers, covered_by_circle(pick(covers, distance, 1.0f), pick(covers, rho, 0.5f)), 0.0f);
}
#endif

#ifdef HAS_CLIP
// Where a plane cuts the disc around a query point.
STRUCT(Chord)
struct Chord {
    Real distance; // from the point, in radii; 1 or more when the plane does not cut the disc
    Vec3 towards;  // unit, in the tangent plane, from the point to the chord
};

// Object i, a plane, as seen from a point of another surface.
Chord chord_of(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    Chord chord;
    Vec3 normal = object_anchor_same(i);
    Real beyond = object_extent_same(i) - dot3(normal, surface.position);
    Real cosine = dot3(normal, surface.normal);
    Vec3 across = sub3(normal, scale3(surface.normal, cosine));
    Real sine = sqrt(dot3(across, across));
    chord.towards = scale3(across, copysign(lanes(1.0f), beyond) / max(sine, lanes(1e-6f)));
    // Parallel planes divide by zero: infinity or NaN, neither of which is below 1.
    chord.distance = fabs(beyond) / sine * inverse_radius;
#ifdef HAS_SPHERES
    // On a sphere the plane cuts a circle. Lambert's equal-area map of the sphere around the point keeps areas and
    // chordal distances, hence the kernel; in it the circle is taken as straight at its nearest point.
    if (any_lane(surface.object < SPHERE_COUNT)) {
        Bool on_sphere = surface.object < SPHERE_COUNT;
        Real radius = object_extent(pick_i(on_sphere, surface.object, 0));
        Vec3 center = object_anchor(pick_i(on_sphere, surface.object, 0));
        Vec3 outward = scale3(sub3(surface.position, center), 1.0f / radius);
        Real point_cosine = dot3(normal, outward);
        Real circle_cosine = beyond / radius + point_cosine;
        Real point_sine = sqrt(max(1.0f - point_cosine * point_cosine, lanes(0.0f)));
        Real circle_sine = sqrt(max(1.0f - circle_cosine * circle_cosine, lanes(0.0f)));
        // 2(1 − cos(A − B)), written without cancellation: the squared distance of two points of a unit circle.
        Real dc = point_cosine - circle_cosine;
        Real ds = point_sine - circle_sine;
        Real chordal = sqrt(dc * dc + ds * ds) * radius * inverse_radius;
        // A circle of less than R/20 takes 1/400 of the disc at most, and no chord at all resembles it; a sphere that
        // just touches the plane has one or none by the last bit.
        chordal = pick(circle_sine * radius * inverse_radius > 0.05f, chordal, INFINITE);
        chord.distance = pick(on_sphere, chordal, chord.distance);
    }
#endif
    // The surface's own plane cuts nothing.
    chord.distance = pick(surface.object == i, INFINITE, chord.distance);
    return chord;
}

// The kernel's integral over the part of the disc that lies on the query point's side of every plane. Exact on a
// plane for one chord, for two at any angle, and for opposite pairs; on a sphere the circles are taken as chords.
Real visible_part(SCENE_PARAMS Surface surface, Real inverse_radius) {
    Real part = lanes(1.0f);
    int first = SPHERE_COUNT;
    int end = first + PLANE_COUNT;
    for (int i = first; i < end; i++) {
        Chord chord = chord_of(SCENE i, surface, inverse_radius);
        Bool cuts = chord.distance < 1.0f;
        if (any_lane(cuts)) {
            // Lanes without a cut work on a distance of 1, where nothing is beyond.
            Real a = pick(cuts, chord.distance, 1.0f);
            part -= beyond_chord(a);
            // What two planes cut off together was taken away twice.
            for (int j = first; j < i; j++) {
                Chord other = chord_of(SCENE j, surface, inverse_radius);
                Bool both = cuts && other.distance < 1.0f;
                if (any_lane(both)) {
                    Real b = pick(both, other.distance, 1.0f);
                    Real cosine = dot3(chord.towards, other.towards);
                    part += pick(both, beyond_both(a, b, cosine), 0.0f);
                }
            }
        }
    }
#ifdef HAS_FOOTPRINTS
    // What a plane cuts off of a footprint is taken away twice.
    for (int i = 0; i < first; i++) part -= footprint(SCENE i, surface, inverse_radius);
#endif
    // Three planes that meet in a needle take the same part away thrice; a corner of 1° still keeps 1/360.
    return max(part, lanes(1e-3f));
}
#endif
