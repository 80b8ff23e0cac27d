// Prefix sums over a work-group of GROUP, for kernels that scan something of their own: included where GROUP is known.

// What all work-items before this one have: Hillis & Steele. `sums` is one of each work-item.
uint before_item(uint own, __local uint *sums) {
    uint item = get_local_id(0);
    sums[item] = own;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint reach = 1u; reach < GROUP; reach <<= 1u) {
        uint before = item >= reach ? sums[item - reach] : 0u;
        barrier(CLK_LOCAL_MEM_FENCE);
        sums[item] += before;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    return sums[item] - own;
}
