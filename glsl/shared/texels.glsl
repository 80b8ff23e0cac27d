// Irradiance texels: every sheet is cut into a chart of cells, and each cell knows the irradiance that
// photons of at least one bounce bring to it (precomputed irradiance: Christensen, "Faster Photon Map Global
// Illumination", JGT 1999). Final gathering looks up what it sees there, one texel a ray.

#ifdef HAS_CHARTS
// The texel of a surface point: its sheet's chart, once for each side.
INLINE Int texel_of(SCENE_PARAMS Surface surface) {
    ChartPoint at;
#each shape
#ifdef HAS_KINDS
    ChartPoint on_kind = kind_chart(SCENE surface);
#ifdef KIND_COMES_FIRST
    at = on_kind;
#else
    at.u = pick(IS_KIND(surface.shape), on_kind.u, at.u);
    at.v = pick(IS_KIND(surface.shape), on_kind.v, at.v);
#endif
#endif
#end each
    Int sheet = SHEET_OF_SHAPE(surface.shape);
    Real columns = chart_columns(sheet);
    Real rows = chart_rows(sheet);
    Real column = min(max((at.u * 0.5f + 0.5f) * columns, lanes(0.0f)), columns - 1.0f);
    Real row = min(max((at.v * 0.5f + 0.5f) * rows, lanes(0.0f)), rows - 1.0f);
    Int cell = to_int(row) * to_int(columns) + to_int(column);
    Int back = pick_i(surface.side < 0.0f, to_int(columns) * to_int(rows), 0);
    return to_int(chart_first(sheet)) + back + cell;
}
#endif
