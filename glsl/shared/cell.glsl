// The photon grid's cells: from a point to a cell, from a row of cells to its place in the table.
//
// A face is one side of one object: 2·object + (0 the side its normal points to | 1 the other). Every face has cells
// of its own, so that a query meets photons of its own surface and side only and tests neither. Cells along u are
// neighbours in memory: a query reads one run of sorted photons per row of cells.
//
// Dense: each face's cells fill the box of its own photons. Hashed (GRID_HASHED): a row begins at a hashed bucket of
// a table that faces share (Teschner et al., "Optimized Spatial Hashing", VMV 2003). Rows of different v, w that share a
// bucket are told apart by their photons' positions, which say what row they are in. Rows of the same v, w on different
// faces begin farther apart than any query reaches (`hash_reach` of plan/cells); faces whose u and v are exchanged, where
// the same numbers mean another place, have a table of their own.

// u, v, w are x, y, z, except on planes across x: those have only one or two cells along x, so y takes its place.
Float3 grid_axes(Float3 p, float flipped) { return flipped != 0.0f ? triple(p.y, p.x, p.z) : p; }

// A cell's size, or its inverse, along u, v, w.
Float3 cell_axes(Float3 size, float flipped, float by_rows) { return by_rows != 0.0f ? size : grid_axes(size, flipped); }

// Floats count to 2²⁴ exactly. What lies farther out shares the last cells: photons and queries alike.
#define MAX_CELL 8000000.0f

// Whether a cell is one of those, which have no end.
bool is_endless(int cell) { return abs(cell) >= 8000000; }

// A point's distance from the face's first cell, in cells along one axis, rounded down. By truncation: floor() is a
// library call on PoCL and took most of the time that keys took.
int cell_along(float distance, float inverse_cell) {
    float cells = min(max(distance * inverse_cell, -MAX_CELL), MAX_CELL);
    int towards_zero = count_of(cells);
    return towards_zero - (float_of(towards_zero) > cells ? 1 : 0);
}

#ifdef GRID_HASHED
// Where in the table (of a power-of-two length) the row (v, w) of a face has its cell u = 0, before wrapping.
int row_start(int base, int v, int w) {
    uint h = (uint_of(v) * 73856093u) ^ (uint_of(w) * 19349663u);
    // Wellons' lowbias32: rows that are neighbours must not overlap in the table as well.
    h = (h ^ (h >> 16u)) * 0x7feb352du;
    h = (h ^ (h >> 15u)) * 0x846ca68bu;
    return base + count_of((h ^ (h >> 16u)) >> 8u);
}

// Which photons of the buckets that a row shares are its own: those whose distances along v and w cell_along rounds down
// to it. Bounds say that without rounding anything for each photon.
STRUCT(Row)
struct Row {
    float flipped;
    float inverse_v; // 1 / a cell's size, 1/m
    float inverse_w;
    float v_least;   // in cells
    float v_limit;
    float w_least;
    float w_limit;
};

Row row_of(int v, int w, Float3 inverse_cell, float flipped) {
    Row row;
    row.flipped = flipped;
    row.inverse_v = inverse_cell.y;
    row.inverse_w = inverse_cell.z;
    row.v_least = v <= -8000000 ? -3e38f : float_of(v);
    row.v_limit = v >= 8000000 ? 3e38f : float_of(v) + 1.0f;
    row.w_least = w <= -8000000 ? -3e38f : float_of(w);
    row.w_limit = w >= 8000000 ? 3e38f : float_of(w) + 1.0f;
    return row;
}

bool is_in_row(Row row, Float3 photon) {
    float v = (row.flipped != 0.0f ? photon.x : photon.y) * row.inverse_v;
    float w = photon.z * row.inverse_w;
    return v >= row.v_least && v < row.v_limit && w >= row.w_least && w < row.w_limit;
}
#define CELL_ROW_PARAM Row row,
#define CELL_ROW row,
#else
#define CELL_ROW_PARAM
#define CELL_ROW
// The same where cells fill a box: counts are cells along u, v, w.
int row_start(int base, int v, int w, Float3 counts) { return base + (w * count_of(counts.y) + v) * count_of(counts.x); }
#endif
