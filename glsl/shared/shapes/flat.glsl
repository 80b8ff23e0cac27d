// What flat shapes share: their anchor is the unit normal n, their extent the offset d of dot(n, p) = d.
#ifndef FLAT_SHAPES
#define FLAT_SHAPES

// A hit point p put back on its plane.
INLINE Placed flat_place(Vec3 normal, Real offset, Vec3 p) {
    Placed placed;
    placed.normal = normal;
    placed.position = add3(p, scale3(normal, offset - dot3(normal, p)));
    return placed;
}

#ifdef HAS_TWO_SIDED
// Whether the shape was met from the side that its normal does not point to.
INLINE Bool flat_met_behind(Hit hit, Vec3 origin, Vec3 direction, Vec3 normal, Real offset) {
    return dot3(normal, direction) > 0.0f;
}
#endif

#ifdef HAS_CHARTS
// Coordinates along two axes, straight or, where the plane has no end, bent: x/(1 + |x|) < 1.
INLINE ChartPoint flat_chart(SCENE_PARAMS Surface surface) {
    Int sheet = SHEET_OF_SHAPE(surface.shape);
    Real u = dot3(chart_axis_u(sheet), surface.position) + chart_offset_u(sheet);
    Real v = dot3(chart_axis_v(sheet), surface.position) + chart_offset_v(sheet);
    Real bend = chart_bend(sheet);
    ChartPoint at;
    at.u = u / (1.0f + bend * fabs(u));
    at.v = v / (1.0f + bend * fabs(v));
    return at;
}
#endif

#ifdef HAS_CLIP
// The line of flat shape i, as if it had no end, as seen from a point of another surface.
INLINE Cut flat_cut(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
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
#endif
#endif
