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

// What GLSL would hold as globals: emitters, a record a light; emitter_counts, three uints a light: its slots of a
// round, its first cell of the emission map, its cells; slots: light << SLOTS_LOG2 | rank among the light's own slots.
#ifndef SLOTS_LOG2
#define SLOTS_LOG2 12u
#endif
#define SLOTS (1u << SLOTS_LOG2)
#define EMISSION_ROWS (1u << EMISSION_ROWS_LOG2)
#define EMISSION_COLUMNS (1u << EMISSION_COLUMNS_LOG2)
#define EMISSION_CELL_BITS (EMISSION_ROWS_LOG2 + EMISSION_COLUMNS_LOG2)
#define EMISSION_PARAMS __global const float *emitters, __global const uint *emitter_counts, \
    __global const uint *slots, __global const uint *emission_cells,
#define EMISSION emitters, emitter_counts, slots, emission_cells,
#include "shared/walk.glsl"

// Paths [first_path, end_path) in runs of run_length; `stream` is the hash of seed and pass.
#define WALK_PARAMS SCENE_PARAMS EMISSION_PARAMS uint first_path, uint end_path, uint run_length, uint stream
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
