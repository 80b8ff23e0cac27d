// Runs one of the stress suites' bodies (shared/stress.glsl) for each lane and stores its eight words.
#include "shim.cl"
#ifdef STRESS_LEAKS
#include "divergent_fetch.cl"
#define RECORDS_cases (FEW_RECORDS + 1) // always more than a few
#endif
#include "layout"
#include "shared/random.glsl"
#ifdef CONTRACTED
#include "rounding.cl"
#endif
#include "shared/vector.glsl"
#include "shared/sampling.glsl"
#include "shared/surface.glsl"
#include "shapes"
#ifdef CONTRACTED
#define hit_plane(origin, direction, normal, offset, on) nudge(hit_plane(origin, direction, normal, offset, on))
#endif
#include "shared/faults.glsl"
#include "shared/scene.glsl"
#include "shared/stress.glsl"

#if LANES == 1
#define LANE_ID 0
#define PUT(word, value) answers[base * 8 + word] = value;
#else
#define LANE_ID (LANE_ROW * LANE_COLUMNS + LANE_COLUMN)
#define PUT(word, value) CONCAT(vstore, LANES)(value, 0, each); \
    for (int lane = 0; lane < LANES && base + lane < count; lane++) answers[(base + lane) * 8 + word] = each[lane];
#endif

// Global size: ceil(count / LANES). Answers of items first … first + count − 1.
__kernel void stress_items(SCENE_PARAMS CASES_PARAMS __global uint *answers, int first, int count) {
    int base = (int)get_global_id(0) * LANES;
    if (base >= count) return;
    // Lanes past the end do the last item's work again: reading beyond a table is nobody's right.
    Int i = min(lanes_i(base) + LANE_ID, lanes_i(count - 1)) + first;
    Answer answer = stress(SCENE CASES i);
#if LANES > 1
    uint each[LANES];
#endif
    PUT(0, answer.a)
    PUT(1, answer.b)
    PUT(2, answer.c)
    PUT(3, answer.d)
    PUT(4, answer.e)
    PUT(5, answer.f)
    PUT(6, answer.g)
    PUT(7, answer.h)
}
