// Work-items of a group, 8 × 8 pixels, gather together (GATHER_GROUP): what lanes are to a CPU's work-item. They walk over
// the photons near all of them, take these from memory side by side into a queue in local memory, and each item weighs
// the whole queue. Every item comes here, with or without a query of its own: barriers wait for all.
#ifdef GATHER_GROUP

// A queue entry is position and power, and the direction that glossy lobes ask for; w is not used. QUEUE_LENGTH of them: a
// multiple of GROUP_SIZE, and no more than SUM_BLOCK, whose sums do not stall.

int group_item() { return (int)(get_local_id(1) * get_local_size(0) + get_local_id(0)); }

// Weighs what the queue holds; then it may be filled again.
Gathered weigh_queue(SCENE_PARAMS Gathered sum, Query query) {
    Vec3 none = make3(0.0f, 0.0f, 0.0f);
    float inverse_radius2 = gather_inverse_radius() * gather_inverse_radius();
    Gathered part = nothing_gathered();
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int n = 0; n < sum.queued; n++) {
        float3 position = queue[n].xyz;
        float3 away = position - query.surface.position;
        float weight = kernel_shape(square3(away), inverse_radius2);
#ifdef DEAR_PHOTONS
        if (weight <= 0.0f) continue;
#endif
#ifdef HAS_GLOSSY
        part = add_light(SCENE part, weight, position, queue[QUEUE_LENGTH + n].xyz, queue[2 * QUEUE_LENGTH + n].xyz, query);
#else
        part = add_light(SCENE part, weight, position, queue[QUEUE_LENGTH + n].xyz, none, query);
#endif
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    sum = add_gathered(sum, part);
    sum.queued = 0;
    return sum;
}

// Appends a run of candidates to the queue, and weighs it whenever it is full. `cell`: where the run's row of cells is.
Gathered queue_photons(SCENE_PARAMS Gathered sum, int first, int end, CELL_ROW_PARAM Query query) {
    int item = group_item();
    while (first < end) {
        int taken = min(end - first, QUEUE_LENGTH - sum.queued);
        for (int n = item; n < taken; n += GROUP_SIZE) {
            int i = PHOTON_AT(first + n);
            float3 position = photon_position_same(i);
#ifdef GRID_HASHED
            // Another row's: where no query is.
            if (!is_in_row(row, position)) position = (float3)(-1e18f);
#endif
            queue[sum.queued + n].xyz = position;
            queue[QUEUE_LENGTH + sum.queued + n].xyz = photon_power_same(i);
#ifdef HAS_GLOSSY
            queue[2 * QUEUE_LENGTH + sum.queued + n].xyz = photon_direction_same(i);
#endif
        }
        first += taken;
        sum.queued += taken;
        if (sum.queued == QUEUE_LENGTH) sum = weigh_queue(SCENE sum, query);
    }
    return sum;
}

// Photons of the items' faces (or regions), one after the other, as lanes do.
Gathered gather_group(SCENE_PARAMS Query query, int face, int wanted) {
    Gathered sum = nothing_gathered();
    float3 p = query.surface.position;
    float spread = gather_radius() * GATHER_SPREAD;
    int item = group_item();
    // Between gatherings the queue's memory serves to agree on who gathers: boxes of a group's points.
    __local float4 *low = queue;
    __local float4 *high = queue + GROUP_SIZE;
    int waiting = wanted;
    while (true) {
        // The highest face, of the first item that waits for it.
        low[item] = (float4)(p, waiting ? float_of(face) : -1.0f);
        for (int half_size = GROUP_SIZE / 2; half_size > 0; half_size /= 2) {
            barrier(CLK_LOCAL_MEM_FENCE);
            if (item < half_size && low[item + half_size].w > low[item].w) low[item] = low[item + half_size];
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        float4 chosen = low[0];
        barrier(CLK_LOCAL_MEM_FENCE);
        if (chosen.w < 0.0f) break;
        // Items far from it have little in common with it.
        float3 apart = fabs(p - chosen.xyz);
        int together = waiting && float_of(face) == chosen.w && max(max(apart.x, apart.y), apart.z) <= 0.5f * spread;
        low[item].xyz = together ? p : (float3)(3e38f);
        high[item].xyz = together ? p : (float3)(-3e38f);
        for (int half_size = GROUP_SIZE / 2; half_size > 0; half_size /= 2) {
            barrier(CLK_LOCAL_MEM_FENCE);
            if (item < half_size) {
                low[item].xyz = min(low[item].xyz, low[item + half_size].xyz);
                high[item].xyz = max(high[item].xyz, high[item + half_size].xyz);
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        float3 box_low = low[0].xyz, box_high = high[0].xyz;
        barrier(CLK_LOCAL_MEM_FENCE);
        // Items that do not take part stand where no photon is.
        query.surface.position = together ? p : (float3)(1e18f);
        Gathered part = gather_face(SCENE count_of(chosen.w), query, box_low, box_high);
        sum = add_gathered(sum, part);
        waiting = waiting && !together;
    }
    return sum;
}
#endif
