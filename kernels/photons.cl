// Emission: paths from the lights, a photon stored at each diffuse or glossy surface on their way.
//
// A lane walks one path after the other: when one ends, the next begins in the same lane, so that lanes never wait for
// the longest path among them. The map is in path order, and then in bounce order; no photon is lost, and no order
// depends on scheduling. GPUs walk twice: first the photons of each run of consecutive paths are counted, then the
// counts are scanned (scan.cl), then the same walks are made again and write. CPUs walk once: see photons_record.
#include "shim.cl"
#include "incoherent.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/intersect.glsl"
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
#if LANES == 1
#define LOAD_RUNS(table) table[FIRST_RUN]
#define STORE_RUNS(v, table) table[FIRST_RUN] = v
#else
#define LOAD_RUNS(table) CONCAT(vload, LANES)(get_global_id(0), table)
#define STORE_RUNS(v, table) CONCAT(vstore, LANES)(v, get_global_id(0), table)
#endif

INLINE Uint run_start(Uint run, uint first_path, uint end_path, uint run_length) {
    return min(run * run_length + first_path, lanes_u(end_path));
}

// counts[run]: photons that each run stores.
__kernel void photons_count(WALK_PARAMS, __global uint *counts, uint runs) {
    if (FIRST_RUN >= runs) return;
    Uint run = lanes_u(FIRST_RUN) + LANE_NUMBER;
    Uint path = run_start(run, first_path, end_path, run_length);
    Uint end = run_start(run + 1u, first_path, end_path, run_length);
    Uint count = lanes_u(0u);
    Photon photon = no_photon();
    Bool alive = NO_LANE;
    while (any_lane(path < end)) {
        if (any_lane(!alive)) photon = pick_photon(alive, photon, emit_photon(SCENE EMISSION path, stream));
        Step step = walk(SCENE photon);
        count += pick_u(step.stored && path < end, 1u, 0u);
        photon = step.photon;
        alive = step.survives;
        path += pick_u(alive, 0u, 1u);
    }
    STORE_RUNS(count, counts);
    // One count more than there are runs: the scan turns it into the sum of all.
    if (FIRST_RUN == 0u) counts[(runs + LANES - 1u) / LANES * LANES] = 0u;
}

// The path that stores photon number `wanted` of a run, from 1 on: `--stored` stops there. One work-item, one run.
__kernel void photons_last(WALK_PARAMS, uint wanted, __global uint *last_path) {
    Uint path = lanes_u(first_path);
    uint count = 0u;
    Photon photon = no_photon();
    Bool alive = NO_LANE;
    uint number = first_path;
    while (number < end_path) {
        if (any_lane(!alive)) photon = emit_photon(SCENE EMISSION lanes_u(number), stream);
        Step step = walk(SCENE photon);
        if (any_lane(step.stored)) count++;
        if (count == wanted) break;
        photon = step.photon;
        alive = step.survives;
        if (!any_lane(alive)) number++;
    }
    *last_path = number;
}

// The side of the object that a photon lands on: 2·object + (0 | 1).
INLINE Real face_of(Surface surface) { return to_real(surface.object) * 2.0f + pick(surface.side < 0.0f, 1.0f, 0.0f); }

// What a photon leaves in the map, a table a property.
#ifdef HAS_GLOSSY
#define MAP_PARAMS __global float *positions, __global float *powers, __global float *faces, __global float *directions
#define MAP positions, powers, faces, directions
#else
#define MAP_PARAMS __global float *positions, __global float *powers, __global float *faces
#define MAP positions, powers, faces
#endif

#if LANES == 1
void store_photon(Bool stored, Uint slot, Photon photon, Surface surface, MAP_PARAMS) {
    if (!stored) return;
    vstore3(surface.position, slot, positions);
    vstore3(photon.throughput * photon.power, slot, powers);
    faces[slot] = face_of(surface);
#ifdef HAS_GLOSSY
    vstore3(-photon.direction, slot, directions);
#endif
}

// The same walks, which now write, each run from its offset on. Slots from `limit` on are dropped.
__kernel void photons_store(WALK_PARAMS, __global const uint *offsets, uint runs, uint limit, MAP_PARAMS) {
    if (FIRST_RUN >= runs) return;
    Uint run = lanes_u(FIRST_RUN) + LANE_NUMBER;
    Uint path = run_start(run, first_path, end_path, run_length);
    Uint end = run_start(run + 1u, first_path, end_path, run_length);
    Uint slot = LOAD_RUNS(offsets);
    Photon photon = no_photon();
    Bool alive = NO_LANE;
    while (any_lane(path < end)) {
        if (any_lane(!alive)) photon = pick_photon(alive, photon, emit_photon(SCENE EMISSION path, stream));
        Step step = walk(SCENE photon);
        Bool stored = step.stored && path < end && slot < limit;
        store_photon(stored, slot, photon, step.surface, MAP);
        slot += pick_u(stored, 1u, 0u);
        photon = step.photon;
        alive = step.survives;
        path += pick_u(alive, 0u, 1u);
    }
}
#else
// CPUs walk once. A work-item records what its paths leave, in whatever order its lanes come to it, with the number of
// the path: a few thousand records, which its core's cache holds. Then each record is copied to its place, after all
// photons of earlier paths. Lanes take the work-item's next path when theirs ends, so that none is idle before the last.
#ifdef HAS_GLOSSY
#define RECORD 11u
#else
#define RECORD 8u
#endif

// The lanes that are free take the next paths, in the order of lanes.
INLINE Uint deal(Bool alive, Uint path, uint *next) {
    uint paths[LANES];
    int busy[LANES];
    CONCAT(vstore, LANES)(path, 0, paths);
    CONCAT(vstore, LANES)(alive, 0, busy);
    uint n = *next;
    for (uint lane = 0; lane < LANES; lane++) {
        paths[lane] = busy[lane] ? paths[lane] : n;
        n += busy[lane] ? 0u : 1u;
    }
    *next = n;
    return CONCAT(vload, LANES)(0, paths);
}

// Three fields of each lane, one after the other, from `fields` on.
INLINE void spill3(float *fields, Vec3 v) {
    CONCAT(vstore, LANES)(v.x, 0, fields);
    CONCAT(vstore, LANES)(v.y, 1, fields);
    CONCAT(vstore, LANES)(v.z, 2, fields);
}

// Paths [first_path + item · run_length, …) of each work-item; beyond `room` records it only counts. path_counts:
// photons of each path, run_length to a work-item; totals: of each work-item.
__kernel void photons_record(WALK_PARAMS, uint room, __global float *records, __global uint *path_counts,
                             __global uint *totals) {
    uint item = get_global_id(0);
    uint first = first_path + item * run_length;
    uint end = min(first + run_length, end_path);
    __global float *record = records + item * room * RECORD;
    __global uint *counts = path_counts + item * run_length;
    for (uint p = 0u; p < run_length; p++) counts[p] = 0u;
    uint next = first, recorded = 0u;
    Uint path = lanes_u(end);
    Photon photon = no_photon();
    Bool alive = NO_LANE;
    while (true) {
        if (any_lane(!alive)) {
            path = deal(alive, path, &next);
            if (!any_lane(path < end)) break;
            photon = pick_photon(alive, photon, emit_photon(SCENE EMISSION path, stream));
        }
        Step step = walk(SCENE photon);
        Bool stored = step.stored && path < end;
        if (any_lane(stored)) {
            int masks[LANES];
            uint paths[LANES];
            float fields[RECORD * LANES];
            CONCAT(vstore, LANES)(stored, 0, masks);
            CONCAT(vstore, LANES)(path - first, 0, paths);
            spill3(fields, step.surface.position);
            spill3(fields + 3 * LANES, scale3(photon.throughput, photon.power));
            CONCAT(vstore, LANES)(face_of(step.surface), 6, fields);
#ifdef HAS_GLOSSY
            spill3(fields + 7 * LANES, negate3(photon.direction));
#endif
            for (uint lane = 0u; lane < LANES; lane++) {
                if (!masks[lane]) continue;
                if (recorded < room) {
                    for (uint f = 0u; f + 1u < RECORD; f++) record[f] = fields[f * LANES + lane];
                    ((__global uint *)record)[RECORD - 1u] = paths[lane];
                    record += RECORD;
                }
                recorded++;
                counts[paths[lane]]++;
            }
        }
        photon = step.photon;
        alive = step.survives;
    }
    totals[item] = recorded;
}

// Records to their places in the map, from first_slot on. Slots from `limit` on are dropped.
__kernel void photons_place(__global const float *records, __global uint *path_counts, __global const uint *totals,
                            uint room, uint run_length, uint first_slot, uint limit, MAP_PARAMS) {
    uint item = get_global_id(0);
    __global const float *record = records + item * room * RECORD;
    __global uint *places = path_counts + item * run_length;
    uint place = first_slot;
    for (uint i = 0u; i < item; i++) place += totals[i];
    for (uint p = 0u; p < run_length; p++) {
        uint count = places[p];
        places[p] = place;
        place += count;
    }
    // A path's records follow each other in the order of its bounces.
    for (uint r = 0u; r < totals[item]; r++, record += RECORD) {
        uint slot = places[((__global const uint *)record)[RECORD - 1u]]++;
        if (slot >= limit) continue;
        vstore3(vload3(0, record), slot, positions);
        vstore3(vload3(1, record), slot, powers);
        faces[slot] = record[6];
#ifdef HAS_GLOSSY
        vstore3(vload3(0, record + 7), slot, directions);
#endif
    }
}
#endif
