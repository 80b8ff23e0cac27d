// Exclusive prefix sums of uints, in place, any length: every tile scans itself, the tiles' totals are scanned the
// same way one level up (stage/scan.rs), then added. Blelloch, "Prefix Sums and Their Applications", 1990.
//
// A work-group of GROUP work-items scans a tile of GROUP · PER_ITEM values. GROUP is 1 on CPUs: there a tile is one
// plain loop, and barriers, which CPU drivers pay for dearly, never happen.
#define TILE (GROUP * PER_ITEM)
#if GROUP > 1
#include "group_scan.cl"
#endif

// Each tile of `values` becomes its own exclusive scan; totals[tile] gets its sum, modulo 2³².
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void scan_tiles(__global uint *values, __global uint *totals, uint count) {
    uint tile = get_global_id(0) / GROUP; // a launch may be cut: group numbers begin anew in each piece
    uint first = tile * TILE;
#if GROUP == 1
    uint sum = 0u;
    uint end = min(first + TILE, count);
    for (uint i = first; i < end; i++) {
        uint value = values[i];
        values[i] = sum;
        sum += value;
    }
    totals[tile] = sum;
#else
    __local uint staged[TILE];
    __local uint sums[GROUP];
    uint item = get_local_id(0);
    // Neighbours load neighbours, though each then sums a run of its own: hence the way through local memory.
    for (uint i = item; i < TILE; i += GROUP) staged[i] = first + i < count ? values[first + i] : 0u;
    barrier(CLK_LOCAL_MEM_FENCE);
    uint own = 0u;
    for (uint i = 0u; i < PER_ITEM; i++) own += staged[item * PER_ITEM + i];
    uint sum = before_item(own, sums);
    for (uint i = 0u; i < PER_ITEM; i++) {
        uint value = staged[item * PER_ITEM + i];
        staged[item * PER_ITEM + i] = sum;
        sum += value;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < TILE && first + i < count; i += GROUP) values[first + i] = staged[i];
    if (item == GROUP - 1u) totals[tile] = sum;
#endif
}

// Adds to each tile what all tiles before it sum to. The first tile has nothing before it: group 0 takes tile 1.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void scan_add(__global uint *values, __global const uint *totals, uint count) {
    uint tile = get_global_id(0) / GROUP + 1u;
    uint before = totals[tile];
    uint end = min(tile * TILE + TILE, count);
    for (uint i = tile * TILE + get_local_id(0); i < end; i += GROUP) values[i] += before;
}
