// What is left of a density kernel's integral where planes cut the disc around a point, and spheres cover it.

#ifdef HAS_CLIP
// The line in which a plane cuts the tangent plane around a query point: points p (from the query point, in radii) with
// dot(across, p) = beyond.
STRUCT(Cut)
struct Cut {
    Vec3 across; // the part in the tangent plane of the plane's normal, from the query point towards it
    Real sine2;  // its squared length: the line is beyond/√sine2 away
    Real beyond; // more than 0, so that arctan2 has an angle on the very line
};

// Plane i as seen from a point of another surface.
INLINE Cut cut_of(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    Cut cut;
    Vec3 normal = shape_anchor_same(i);
    Real offset = shape_extent_same(i) - dot3(normal, surface.position);
    Vec3 across = sub3(normal, scale3(surface.normal, dot3(normal, surface.normal)));
    cut.across = scale3(across, copysign(lanes(1.0f), offset));
    cut.sine2 = dot3(across, across);
    cut.beyond = fabs(offset) * inverse_radius;
#ifdef HAS_SPHERES
    if (any_lane(IS_SPHERE(surface.shape))) {
        Bool on_sphere = IS_SPHERE(surface.shape);
        Real chordal = sphere_cut(SCENE pick_i(on_sphere, surface.shape, 0), surface.position, normal, offset, inverse_radius);
        cut.beyond = pick(on_sphere, chordal * sqrt(cut.sine2), cut.beyond);
    }
#endif
    // The surface's own plane cuts nothing, nor does one along it, whose line is nowhere. (Around a sphere's pole it cuts a
    // circle, which no line resembles.)
    cut.beyond = pick(surface.shape == i || cut.sine2 < 1e-12f, INFINITE, max(cut.beyond, lanes(1e-12f)));
    return cut;
}

Bool crosses_disc(Cut cut) { return cut.beyond * cut.beyond < cut.sine2; }

// The first plane after shape i whose line crosses the disc of any lane; the planes' end where there is none.
INLINE int next_cut(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    int end = END_PLANE;
    int next = end;
    // To the end, wherever it is found: a loop that lanes leave at different rounds may not be asked for more than a sum
    // (gather.glsl).
    for (int j = end - 1; j >= FIRST_PLANE; j--) {
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
    int first = FIRST_PLANE;
    int end = END_PLANE;
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
    for (int k = FIRST_SPHERE; k < END_SPHERE; k++) part -= sphere_footprint(SCENE k, surface, inverse_radius);
#endif
    // Rounding may leave nothing; a needle of a degree still keeps 1/360.
    return max(part, lanes(1e-3f));
}
#endif
