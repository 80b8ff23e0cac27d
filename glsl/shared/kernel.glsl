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
// The line in which a plane cuts the tangent plane around a query point: points p (from the query point, in radii) with
// dot(across, p) = beyond.
STRUCT(Cut)
struct Cut {
    Vec3 across; // the part in the tangent plane of the plane's normal, from the query point towards it
    Real sine2;  // its squared length: the line is beyond/√sine2 away
    Real beyond; // more than 0, so that arctan2 has an angle on the very line
};

// Object i, a plane, as seen from a point of another surface.
INLINE Cut cut_of(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    Cut cut;
    Vec3 normal = object_anchor_same(i);
    Real offset = object_extent_same(i) - dot3(normal, surface.position);
    Vec3 across = sub3(normal, scale3(surface.normal, dot3(normal, surface.normal)));
    cut.across = scale3(across, copysign(lanes(1.0f), offset));
    cut.sine2 = dot3(across, across);
    cut.beyond = fabs(offset) * inverse_radius;
#ifdef HAS_SPHERES
    // On a sphere the plane cuts a circle. Lambert's equal-area map of the sphere around the point keeps areas and
    // chordal distances, hence the kernel; in it the circle is taken as straight at its nearest point.
    if (any_lane(surface.object < SPHERE_COUNT)) {
        Bool on_sphere = surface.object < SPHERE_COUNT;
        Real radius = object_extent(pick_i(on_sphere, surface.object, 0));
        Vec3 center = object_anchor(pick_i(on_sphere, surface.object, 0));
        Vec3 outward = scale3(sub3(surface.position, center), 1.0f / radius);
        Real point_cosine = dot3(normal, outward);
        Real circle_cosine = offset / radius + point_cosine;
        Real point_sine = sqrt(max(1.0f - point_cosine * point_cosine, lanes(0.0f)));
        Real circle_sine = sqrt(max(1.0f - circle_cosine * circle_cosine, lanes(0.0f)));
        // 2(1 − cos(A − B)), written without cancellation: the squared distance of two points of a unit circle.
        Real dc = point_cosine - circle_cosine;
        Real ds = point_sine - circle_sine;
        Real chordal = sqrt(dc * dc + ds * ds) * radius * inverse_radius;
        // A circle of less than R/20 takes 1/400 of the disc at most, and no chord at all resembles it; a sphere that
        // just touches the plane has one or none by the last bit.
        chordal = pick(circle_sine * radius * inverse_radius > 0.05f, chordal, INFINITE);
        cut.beyond = pick(on_sphere, chordal * sqrt(cut.sine2), cut.beyond);
    }
#endif
    // The surface's own plane cuts nothing, nor does one along it, whose line is nowhere. (Around a sphere's pole it cuts a
    // circle, which no line resembles.)
    cut.beyond = pick(surface.object == i || cut.sine2 < 1e-12f, INFINITE, max(cut.beyond, lanes(1e-12f)));
    return cut;
}

Bool crosses_disc(Cut cut) { return cut.beyond * cut.beyond < cut.sine2; }

// The first plane after object i whose line crosses the disc of any lane; the objects' end where there is none.
INLINE int next_cut(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    int end = SPHERE_COUNT + PLANE_COUNT;
    int next = end;
    // To the end, wherever it is found: a loop that lanes leave at different rounds may not be asked for more than a sum
    // (gather.glsl).
    for (int j = end - 1; j >= SPHERE_COUNT; j--) {
        Cut cut = cut_of(SCENE j, surface, inverse_radius);
        if (j > i && any_lane(crosses_disc(cut))) next = j;
    }
    return next;
}

// The kernel's integral over the part of the disc that lies on the query point's side of every plane. That part is
// bounded by the rim and by pieces of chords, and what lies beyond each piece is seen from the centre in a sector of its
// own. Exact on a plane, for any number of planes; on a sphere the circles are taken as chords.
Real visible_part(SCENE_PARAMS Surface surface, Real inverse_radius) {
    Real lost = lanes(0.0f);
    int first = SPHERE_COUNT;
    int end = first + PLANE_COUNT;
    int i = next_cut(SCENE first - 1, surface, inverse_radius);
    if (i < end) do {
        Cut cut = cut_of(SCENE i, surface, inverse_radius);
        // Lanes without a cut work on a distance of 1, where the chord has no length.
        Real steep = 1.0f / sqrt(max(cut.sine2, lanes(1e-12f)));
        Real h = pick(crosses_disc(cut), cut.beyond * steep, 1.0f);
        Vec3 towards = scale3(cut.across, steep);
        Vec3 along = cross3(surface.normal, towards);
        // The chord's piece on the query point's side of all others.
        Real high = sqrt(max(1.0f - h * h, lanes(0.0f)));
        Real low = -high;
        for (int j = first; j < end; j++) {
            if (j == i) continue;
            Cut other = cut_of(SCENE j, surface, inverse_radius);
            Real room = other.beyond - h * dot3(other.across, towards);
            Real slope = dot3(other.across, along);
            // Of lines that lie in one another, by all that rounding leaves of them, the first counts.
            Real tie = sqrt(other.sine2) * (j < i ? -1e-4f : 1e-4f);
            room += pick(slope * slope < 1e-10f * other.sine2, tie, 0.0f);
            // Parallel lines cross far away, on the side that leaves all or nothing.
            slope = copysign(max(fabs(slope), lanes(1e-20f)), slope);
            Real crossing = room / slope;
            high = pick(slope > 0.0f, min(high, crossing), high);
            low = pick(slope > 0.0f, low, max(low, crossing));
        }
        lost += pick(low < high, beyond_chord(h, low, high), 0.0f);
        i = next_cut(SCENE i, surface, inverse_radius);
    } while (i < end);
    Real part = 1.0f - lost * TWO_PI_INV;
#ifdef HAS_FOOTPRINTS
    // What a plane cuts off of a footprint is taken away twice.
    for (int i = 0; i < first; i++) part -= footprint(SCENE i, surface, inverse_radius);
#endif
    // Rounding may leave nothing; a needle of a degree still keeps 1/360.
    return max(part, lanes(1e-3f));
}
#endif
