// What is left of a density kernel's integral where planes cut the disc around a point, and spheres cover it.

#ifdef HAS_CLIP
// Cut c of all that the kinds have.
INLINE Cut cut_of(SCENE_PARAMS int c, Surface surface, Real inverse_radius) {
    Cut cut;
    cut.across = surface.normal;
    cut.sine2 = lanes(1.0f);
    cut.beyond = lanes(INFINITE);
#each shape
#if defined(HAS_KINDS) && KIND_CUTS > 0
    if (c >= FIRST_CUT_OF_KIND && c < END_CUT_OF_KIND) {
        int number = c - FIRST_CUT_OF_KIND;
        cut = kind_cut(SCENE FIRST_KIND + number / KIND_CUTS, number % KIND_CUTS, surface, inverse_radius);
    }
#endif
#end each
    return cut;
}

Bool crosses_disc(Cut cut) { return cut.beyond * cut.beyond < cut.sine2; }

// The first cut after i whose line crosses the disc of any lane; the end where there is none.
INLINE int next_cut(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    int end = CUT_COUNT;
    int next = end;
    // To the end, wherever it is found: a loop that lanes leave at different rounds may not be asked for more than a sum
    // (gather.glsl).
    for (int j = end - 1; j >= 0; j--) {
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
    int first = 0;
    int end = CUT_COUNT;
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
