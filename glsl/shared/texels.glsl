// Irradiance texels: every object's surface is cut into a chart of cells, and each cell knows the irradiance that
// photons of at least one bounce bring to it (precomputed irradiance: Christensen, "Faster Photon Map Global
// Illumination", JGT 1999). Final gathering looks up what it sees there, one texel a ray.

// Octahedral coordinates of a unit vector, in [−1, 1]²: no trigonometry, and every fold lies on a cell's border or
// its diagonal (Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014).
STRUCT(Octahedral)
struct Octahedral {
    Real u;
    Real v;
};

INLINE Octahedral octahedral(Vec3 n) {
    Real scale = 1.0f / (fabs(n.x) + fabs(n.y) + fabs(n.z));
    Octahedral o;
    o.u = n.x * scale;
    o.v = n.z * scale;
    Real folded_u = copysign(1.0f - fabs(o.v), o.u);
    Real folded_v = copysign(1.0f - fabs(o.u), o.v);
    Bool below = n.y < 0.0f;
    o.u = pick(below, folded_u, o.u);
    o.v = pick(below, folded_v, o.v);
    return o;
}

#ifdef HAS_CHARTS
// The texel of a surface point: its object's chart, once for each side.
INLINE Int texel_of(SCENE_PARAMS Surface surface) {
    // Planes: coordinates along two axes, straight or, where the plane has no end, bent: x/(1 + |x|) < 1.
    Real u = dot3(chart_axis_u(surface.object), surface.position) + chart_offset_u(surface.object);
    Real v = dot3(chart_axis_v(surface.object), surface.position) + chart_offset_v(surface.object);
    Real bend = chart_bend(surface.object);
    u = u / (1.0f + bend * fabs(u));
    v = v / (1.0f + bend * fabs(v));
#ifdef HAS_SPHERES
    Octahedral o = octahedral(scale3(surface.normal, surface.side));
#ifdef HAS_PLANES
    Bool is_sphere = surface.object < SPHERE_COUNT;
    u = pick(is_sphere, o.u, u);
    v = pick(is_sphere, o.v, v);
#else
    u = o.u;
    v = o.v;
#endif
#endif
    Real columns = chart_columns(surface.object);
    Real rows = chart_rows(surface.object);
    Real column = min(max((u * 0.5f + 0.5f) * columns, lanes(0.0f)), columns - 1.0f);
    Real row = min(max((v * 0.5f + 0.5f) * rows, lanes(0.0f)), rows - 1.0f);
    Int cell = to_int(row) * to_int(columns) + to_int(column);
    Int back = pick_i(surface.side < 0.0f, to_int(columns) * to_int(rows), 0);
    return to_int(chart_first(surface.object)) + back + cell;
}
#endif
