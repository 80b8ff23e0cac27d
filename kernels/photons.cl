// Emission: paths from the lights, a photon stored at each diffuse or glossy surface on their way.
//
// A lane walks a run of consecutive paths, one after the other: when one ends, the next begins in the same lane, so
// that lanes never wait for the longest path among them. What a lane stores is therefore in path order, and then in
// bounce order. First every run's photons are counted, then the counts are scanned (scan.cl), then the same walks
// are made again and write: no photon is lost, and no order depends on scheduling.
#include "shim.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/intersect.glsl"
#include "shared/scene.glsl"
#include "shared/bsdf.glsl"
#include "shared/sampling.glsl"
#include "walk.cl"

#define WALK_PARAMS SCENE_PARAMS EMISSION_PARAMS uint paths, uint run_length, uint stream
#define FIRST_LANE ((uint)get_global_id(0) * LANES)
#define RUN (lanes_u(FIRST_LANE) + LANE_NUMBER)

// How many photons each run stores.
__kernel void photons_count(WALK_PARAMS, __global uint *counts, uint runs) {
    if (FIRST_LANE >= runs) return;
    Uint run = RUN;
    Uint path = min(run * run_length, lanes_u(paths));
    Uint end = min(path + run_length, lanes_u(paths));
    Uint count = lanes_u(0u);
    Photon photon = emit_photon(EMISSION path, stream);
    while (any_lane(path < end)) {
        Bool active = path < end;
        Step step = walk(SCENE photon);
        count += pick_u(active && step.stored, 1u, 0u);
        photon = step.photon;
        if (any_lane(active && !step.survives)) {
            path += pick_u(step.survives, 0u, 1u);
            photon = pick_photon(step.survives, photon, emit_photon(EMISSION path, stream));
        }
    }
    STORE_RUNS(counts, FIRST_LANE, runs, count);
}

// Writes them, each run from its offset on; slots from `limit` on are dropped.
__kernel void photons_emit(WALK_PARAMS, __global const uint *offsets, uint runs, uint limit,
                           __global float *positions, __global float *powers, __global float *surfaces,
                           __global float *directions) {
    if (FIRST_LANE >= runs) return;
    Uint run = RUN;
    Uint path = min(run * run_length, lanes_u(paths));
    Uint end = min(path + run_length, lanes_u(paths));
    Uint slot = LOAD_RUNS(offsets, FIRST_LANE, runs);
    Photon photon = emit_photon(EMISSION path, stream);
    while (any_lane(path < end)) {
        Bool active = path < end;
        Step step = walk(SCENE photon);
        Bool stored = active && step.stored && slot < limit;
        if (any_lane(stored)) {
            Vec3 surface = make3(to_real(step.surface.object), step.surface.side, to_real(photon.bounce));
            store_photons(stored, slot, positions, step.surface.position, powers, photon.power, surfaces, surface);
#ifdef HAS_GLOSSY
            store_lanes(stored, slot, directions, negate3(photon.direction));
#endif
        }
        slot += pick_u(stored, 1u, 0u);
        photon = step.photon;
        if (any_lane(active && !step.survives)) {
            path += pick_u(step.survives, 0u, 1u);
            photon = pick_photon(step.survives, photon, emit_photon(EMISSION path, stream));
        }
    }
}
