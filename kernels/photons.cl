// Emission: paths from the lights, a photon stored at each diffuse or glossy surface on their way.
//
// A lane walks one path after the other: when one ends, the next begins in the same lane, so that lanes never wait for
// the longest path among them. The map is in path order, and then in bounce order; no photon is lost, and no order
// depends on scheduling. GPUs walk twice: first the photons of each path are counted, then the counts are scanned
// (scan.cl), then the same walks are made again and write. CPUs walk once: see photons_record.
#include "paths.cl"

// The side of the object that a photon lands on: 2·object + (0 | 1).
INLINE Real face_of(Surface surface) { return to_real(face_left(surface)); }

#if LANES == 1
// A work-group walks consecutive paths, run_length for each of its work-items, and whoever has walked one to its end takes
// the next that nobody has: few wait for the longest of them. What a path stores, and where, depends on its number only.
#define GROUP PHOTONS_GROUP
#include "group_scan.cl"
#define GROUP_NUMBER ((uint)get_global_id(0) / GROUP) // a launch may be cut: group numbers begin anew in each piece
#define GROUP_PATHS (GROUP * run_length)

// counts[path - first_path]: photons that each path stores; totals[group]: those of each group, and behind the last
// group's a 0, which the scan turns into the sum of all.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void photons_count(WALK_PARAMS __global ushort *counts, __global uint *totals) {
    __local uint total, next;
    uint item = get_local_id(0);
    if (item == 0u) {
        total = 0u;
        next = GROUP;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    uint first = first_path + GROUP_NUMBER * GROUP_PATHS;
    uint end = min(first + GROUP_PATHS, end_path);
    uint count = 0u, all = 0u;
    Photon photon = no_photon();
    bool alive = false;
    for (uint path = first + item; path < end;) {
        if (!alive) photon = emit_photon(SCENE EMISSION path, stream);
        Step step = walk(SCENE photon);
        if (step.stored) count++;
        photon = step.photon;
        alive = step.survives;
        if (!alive) {
            counts[path - first_path] = (ushort)count;
            all += count;
            count = 0u;
            path = first + atomic_inc(&next);
        }
    }
    atomic_add(&total, all);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0u) totals[GROUP_NUMBER] = total;
    if (get_global_id(0) == 0u) totals[(end_path - first_path + GROUP_PATHS - 1u) / GROUP_PATHS] = 0u;
}

// Photons that a group gathers in local memory before it writes them. Items walk paths of their own, so that what they
// store at a time lies far apart, seven floats of a photon each in a transaction of its own: by runs of the whole group it
// takes a fraction of them.
#define STAGED PHOTONS_STAGED

// Leaves the photon of a step in tables of any address space.
#ifdef HAS_GLOSSY
#define STORE_DIRECTION(slot, directions) vstore3(-photon.direction, slot, directions)
#else
#define STORE_DIRECTION(slot, directions)
#endif
#define STORE(slot, positions, powers, faces, directions) \
    vstore3(step.surface.position, slot, positions); \
    vstore3(photon.throughput * photon.power, slot, powers); \
    (faces)[slot] = face_of(step.surface); \
    STORE_DIRECTION(slot, directions)

// Copies a group's floats from local memory, work-items side by side.
void copy_out(__local const float *from, uint count, __global float *to) {
    for (uint i = get_local_id(0); i < count; i += GROUP) to[i] = from[i];
}

// The same walks, which now write, each group from its offset on. Slots from `limit` on are dropped.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void photons_store(WALK_PARAMS MAP_PARAMS __global const ushort *counts, __global const uint *offsets, uint limit) {
    __local uint places[GROUP * PHOTONS_RUN]; // of each path's first photon, from the group's first on
    __local uint sums[GROUP];
    __local uint next;
    __local float staged_positions[3 * STAGED], staged_powers[3 * STAGED], staged_faces[STAGED];
#ifdef HAS_GLOSSY
    __local float staged_directions[3 * STAGED];
#endif
    uint item = get_local_id(0);
    if (item == 0u) next = GROUP;
    uint first = first_path + GROUP_NUMBER * GROUP_PATHS;
    uint end = min(first + GROUP_PATHS, end_path);
    // Counts are scanned: neighbours load neighbours, though each then sums a run.
    for (uint i = item; i < GROUP_PATHS; i += GROUP)
        places[i] = first + i < end ? (uint)counts[first + i - first_path] : 0u;
    barrier(CLK_LOCAL_MEM_FENCE);
    uint own = 0u;
    for (uint i = 0u; i < run_length; i++) own += places[item * run_length + i];
    uint sum = before_item(own, sums);
    for (uint i = 0u; i < run_length; i++) {
        uint count = places[item * run_length + i];
        places[item * run_length + i] = sum;
        sum += count;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    uint begin = offsets[GROUP_NUMBER];
    uint place = 0u;
    Photon photon = no_photon();
    bool alive = false;
    for (uint path = first + item; path < end;) {
        if (!alive) {
            photon = emit_photon(SCENE EMISSION path, stream);
            place = places[path - first];
        }
        Step step = walk(SCENE photon);
        if (step.stored) {
            if (place < STAGED) {
                STORE(place, staged_positions, staged_powers, staged_faces, staged_directions);
            } else if (begin + place < limit) {
                STORE(begin + place, photon_positions, photon_powers, photon_faces, photon_directions);
            }
            place++;
        }
        photon = step.photon;
        alive = step.survives;
        if (!alive) path = first + atomic_inc(&next);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    uint count = min(min(offsets[GROUP_NUMBER + 1u], limit) - min(begin, limit), STAGED);
    copy_out(staged_positions, 3u * count, photon_positions + 3u * begin);
    copy_out(staged_powers, 3u * count, photon_powers + 3u * begin);
    copy_out(staged_faces, count, photon_faces + begin);
#ifdef HAS_GLOSSY
    copy_out(staged_directions, 3u * count, photon_directions + 3u * begin);
#endif
}
#else
// counts[run]: photons that each run of consecutive paths stores, one run a lane.
__kernel void photons_count(WALK_PARAMS __global uint *counts, uint runs) {
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
__kernel void photons_last(WALK_PARAMS uint wanted, __global uint *last_path) {
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

// CPUs walk once. Each lane of a work-item walks a run of paths of its own, and a step that stores something is recorded
// as it stands in the lanes: whole vectors, no lane by itself, in memory that the core's cache holds. Within a lane
// records lie in the order of the map already, so that copying them to their places takes no more than a running
// number for each lane.
#ifdef HAS_GLOSSY
#define RECORD 10u
#else
#define RECORD 7u
#endif
#define PLACE_BLOCK 32u

// Paths [first_path + item · LANES · run_length, …) of each work-item. totals, two vectors a work-item: the photons of
// each lane; and how many steps the work-item recorded, in every lane. Beyond `room` steps it only counts.
__kernel void photons_record(WALK_PARAMS uint room, __global float *records, __global uint *totals) {
    uint item = get_global_id(0);
    Uint run = lanes_u(item * LANES) + LANE_NUMBER;
    Uint path = run_start(run, first_path, end_path, run_length);
    Uint end = run_start(run + 1u, first_path, end_path, run_length);
    __global float *record = records + item * room * RECORD * LANES;
    uint recorded = 0u;
    Uint count = lanes_u(0u);
    Photon photon = no_photon();
    Bool alive = NO_LANE;
    while (any_lane(path < end)) {
        if (any_lane(!alive)) photon = pick_photon(alive, photon, emit_photon(SCENE EMISSION path, stream));
        Step step = walk(SCENE photon);
        Bool stored = step.stored && path < end;
        if (any_lane(stored)) {
            if (recorded < room) {
                store_lanes3(record, 0, step.surface.position);
                store_lanes3(record, 3, scale3(photon.throughput, photon.power));
                STORE_LANES(pick(stored, face_of(step.surface), -1.0f), 6, record);
#ifdef HAS_GLOSSY
                store_lanes3(record, 7, negate3(photon.direction));
#endif
                record += RECORD * LANES;
            }
            recorded++;
            count += pick_u(stored, 1u, 0u);
        }
        photon = step.photon;
        alive = step.survives;
        path += pick_u(alive, 0u, 1u);
    }
    STORE_LANES(count, 2u * item, totals);
    STORE_LANES(lanes_u(recorded), 2u * item + 1u, totals);
}

// Records to their places in the map, from first_slot on. Slots from `limit` on are dropped.
__kernel void photons_place(MAP_PARAMS __global const float *records, __global const uint *totals, uint room,
                            uint first_slot, uint limit) {
    uint item = get_global_id(0);
    __global const float *record = records + item * room * RECORD * LANES;
    __global const uint *counts = totals + 2u * item * LANES;
    uint place = first_slot;
    for (uint before = 0u; before < item; before++)
        for (uint lane = 0u; lane < LANES; lane++) place += totals[2u * before * LANES + lane];
    uint places[LANES];
    for (uint lane = 0u; lane < LANES; lane++) {
        places[lane] = place;
        place += counts[lane];
    }
    // A block of steps, which the L1 cache holds, lane by lane: each place in the map is then written to for a while.
    uint steps = counts[LANES];
    for (uint begin = 0u; begin < steps; begin += PLACE_BLOCK) {
        uint end = min(begin + PLACE_BLOCK, steps);
        for (uint lane = 0u; lane < LANES; lane++) {
            uint slot = places[lane];
            __global const float *own = record + begin * RECORD * LANES + lane;
            for (uint s = begin; s < end; s++, own += RECORD * LANES) {
                float face = own[6 * LANES];
                if (face < 0.0f || slot >= limit) continue;
                vstore3((float3)(own[0], own[LANES], own[2 * LANES]), slot, photon_positions);
                vstore3((float3)(own[3 * LANES], own[4 * LANES], own[5 * LANES]), slot, photon_powers);
                photon_faces[slot] = face;
#ifdef HAS_GLOSSY
                vstore3((float3)(own[7 * LANES], own[8 * LANES], own[9 * LANES]), slot, photon_directions);
#endif
                slot++;
            }
            places[lane] = slot;
        }
    }
}
#endif
