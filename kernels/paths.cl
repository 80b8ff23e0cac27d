// What every kernel that walks photon paths shares: the walk itself, and runs of paths. A lane walks a run of
// consecutive paths, one after the other: when one ends, the next begins in the same lane, so that lanes never wait
// for the longest path among them.
#include "shim.cl"
#include "divergent_fetch.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/surface.glsl"
#include "shapes"
#include "shared/scene.glsl"
#include "shared/bsdf.glsl"
#include "shared/sampling.glsl"

// See EMISSION of table_sets.rs for the tables.
#ifndef SLOTS_LOG2
#define SLOTS_LOG2 12u
#endif
#define SLOTS (1u << SLOTS_LOG2)
#define EMISSION_ROWS (1u << EMISSION_ROWS_LOG2)
#define EMISSION_COLUMNS (1u << EMISSION_COLUMNS_LOG2)
#define EMISSION_CELL_BITS (EMISSION_ROWS_LOG2 + EMISSION_COLUMNS_LOG2)
#include "shared/walk.glsl"

#define FIRST_RUN ((uint)get_global_id(0) * LANES)

// Tables of runs are padded to whole work-items.
#if LANES > 1
#define STORE_LANES(v, i, table) CONCAT(vstore, LANES)(v, i, table)
#define STORE_RUNS(v, table) STORE_LANES(v, get_global_id(0), table)

// All lanes' x, then y, then z, as vectors i, i + 1, i + 2 of a table.
INLINE void store_lanes3(__global float *table, uint i, Vec3 v) {
    STORE_LANES(v.x, i, table);
    STORE_LANES(v.y, i + 1u, table);
    STORE_LANES(v.z, i + 2u, table);
}
#endif

INLINE Uint run_start(Uint run, uint first_path, uint end_path, uint run_length) {
    return min(run * run_length + first_path, lanes_u(end_path));
}
