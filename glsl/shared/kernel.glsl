// Density kernels over the unit disc, and their integrals over parts of it.
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

// 1/h of what beyond_chord's powers of the secant integrate to, at distance u from the chord's foot; odd in u.
INLINE Real secants_to(Real h, Real u) {
    Real h2 = h * h;
    Real u2 = u * u;
#if defined(KERNEL_CONSTANT)
    return u;
#elif defined(KERNEL_CONE)
    Real r = sqrt(h2 + u2);
    // asinh(u/h), odd in u; the bound only keeps h = 0 finite, where the factor h² wins.
    Real rise = copysign(log((fabs(u) + r) / max(h, lanes(1e-9f))), u);
    return u * (3.0f - r) - h2 * rise;
#elif defined(KERNEL_BIWEIGHT)
    return u * (3.0f - 3.0f * (h2 + u2 * (1.0f / 3.0f)) + h2 * h2 + u2 * (2.0f / 3.0f * h2 + 0.2f * u2));
#else
    return u * (2.0f - h2 - u2 * (1.0f / 3.0f));
#endif
}

// 2π times the kernel's integral beyond a chord at distance h, over the sector that the centre sees the chord's points
// from `low` to `high` in, which are distances from the chord's foot.
//
// In polar coordinates: ∫ g(h/cos ψ) dψ from atan(low/h) to atan(high/h), where g(r) = 2π·∫ K r' dr' from r to 1 is 1−r²,
// (1−r²)², 1−3r²+2r³ and (1−r²)³ for the four kernels; powers of the secant integrate to polynomials in tan ψ.
INLINE Real beyond_chord(Real h, Real low, Real high) {
    Real angle = arctan2(h * (high - low), h * h + low * high);
    return angle - h * (secants_to(h, high) - secants_to(h, low));
}

#ifdef HAS_FOOTPRINTS
// 2π times the kernel's integral from distance r to the rim, along one direction: g of beyond_chord.
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
#endif
