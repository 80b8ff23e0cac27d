// Stable radix sort of (key, value) pairs by DIGIT_BITS of the key a pass, least significant digit first:
// sort_count → exclusive scan → sort_scatter. Every owner has one run of neighbouring pairs and counts its digits by
// itself, counts[digit][owner]: so a scan of the whole yields each owner's first place for each digit, and the order
// does not depend on scheduling. On CPUs owners are work-items with a loop; on GPUs (GROUP > 1) work-groups, which sort
// their run by the digit in local memory first, so that neighbours write to neighbouring places.
// Knuth, TAOCP 3, §5.2.5; Zagha & Blelloch, "Radix Sort for Vector Multiprocessors", SC 1991; Satish, Harris &
// Garland, "Designing Efficient Sorting Algorithms for Manycore GPUs", IPDPS 2009.
#define DIGITS (1 << DIGIT_BITS)
#define DIGIT(key) (((key) >> shift) & (DIGITS - 1))

#if GROUP == 1
__kernel void sort_count(__global const uint *keys, __global uint *counts, int count, int per_item, int shift,
                         int owners) {
    uint own[DIGITS];
    for (int d = 0; d < DIGITS; d++) own[d] = 0u;
    int item = get_global_id(0);
    if (item >= owners) return;
    int end = min((item + 1) * per_item, count);
    for (int i = item * per_item; i < end; i++) own[DIGIT(keys[i])]++;
    for (int d = 0; d < DIGITS; d++) counts[d * owners + item] = own[d];
}

// Places are the scanned counts. In the first pass (`numbers` = 1) a value is the pair's own number.
__kernel void sort_scatter(__global const uint *keys, __global const uint *values, __global const uint *places,
                           __global uint *sorted_keys, __global uint *sorted_values, int count, int per_item,
                           int shift, int numbers, int owners) {
    uint next[DIGITS];
    int item = get_global_id(0);
    if (item >= owners) return;
    for (int d = 0; d < DIGITS; d++) next[d] = places[d * owners + item];
    int end = min((item + 1) * per_item, count);
    for (int i = item * per_item; i < end; i++) {
        uint key = keys[i];
        uint place = next[DIGIT(key)]++;
        sorted_keys[place] = key;
        sorted_values[place] = numbers ? (uint)i : values[i];
    }
}
#else
// Pairs of a work-group, and of each of its work-items: in blocks, so that order within an item is order in the run.
#define RUN (GROUP * PER_ITEM)
#define HALF_BITS (DIGIT_BITS / 2)
#define HALVES (1 << HALF_BITS)
#define NO_KEY 0xffffffffu
#include "group_scan.cl"

__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void sort_count(__global const uint *keys, __global uint *counts, int count, int per_item, int shift, int owners) {
    __local uint own[DIGITS];
    uint item = get_local_id(0);
    int group = (int)(get_global_id(0) / GROUP); // a launch may be cut: group numbers begin anew in each piece
    for (uint d = item; d < DIGITS; d += GROUP) own[d] = 0u;
    barrier(CLK_LOCAL_MEM_FENCE);
    int first = group * RUN, end = min(first + RUN, count);
    for (int i = first + (int)item; i < end; i += GROUP) atomic_inc(own + DIGIT(keys[i]));
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint d = item; d < DIGITS; d += GROUP) counts[(int)d * owners + group] = own[d];
}

// Places are the scanned counts. In the first pass (`numbers` = 1) a value is the pair's own number.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void sort_scatter(__global const uint *keys, __global const uint *values, __global const uint *places,
                  __global uint *sorted_keys, __global uint *sorted_values, int count, int per_item, int shift,
                  int numbers, int owners) {
    __local uint run_keys[RUN];
    __local uint run_values[RUN];
    // Of each half digit and work-item, how many pairs there are, then which is the next one's place in the run.
    __local ushort next[HALVES * GROUP];
    __local uint sums[GROUP];
    __local uint starts[DIGITS];
    uint item = get_local_id(0);
    int group = (int)(get_global_id(0) / GROUP);
    int first = group * RUN;
    int length = min(RUN, count - first);
    for (int i = (int)item; i < RUN; i += GROUP) {
        run_keys[i] = i < length ? keys[first + i] : NO_KEY; // has the highest digit and comes last: it stays last
        run_values[i] = i < length ? (numbers ? (uint)(first + i) : values[first + i]) : 0u;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int low = shift; low < shift + DIGIT_BITS; low += HALF_BITS) {
        uint own_keys[PER_ITEM], own_values[PER_ITEM];
        for (uint d = 0u; d < HALVES; d++) next[d * GROUP + item] = 0;
        for (uint k = 0u; k < PER_ITEM; k++) {
            own_keys[k] = run_keys[item * PER_ITEM + k];
            own_values[k] = run_values[item * PER_ITEM + k];
            next[((own_keys[k] >> low) & (HALVES - 1)) * GROUP + item]++;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        // Each work-item scans HALVES neighbouring counters.
        uint sum = 0u;
        for (uint d = 0u; d < HALVES; d++) sum += next[item * HALVES + d];
        uint place = before_item(sum, sums);
        for (uint d = 0u; d < HALVES; d++) {
            uint own = next[item * HALVES + d];
            next[item * HALVES + d] = (ushort)place;
            place += own;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint k = 0u; k < PER_ITEM; k++) {
            uint to = next[((own_keys[k] >> low) & (HALVES - 1)) * GROUP + item]++;
            run_keys[to] = own_keys[k];
            run_values[to] = own_values[k];
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    for (int i = (int)item; i < length; i += GROUP) {
        uint digit = DIGIT(run_keys[i]);
        if (i == 0 || DIGIT(run_keys[i - 1]) != digit) starts[digit] = (uint)i;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int i = (int)item; i < length; i += GROUP) {
        uint key = run_keys[i], digit = DIGIT(key);
        uint place = places[(int)digit * owners + group] + (uint)i - starts[digit];
        sorted_keys[place] = key;
        sorted_values[place] = run_values[i];
    }
}
#endif
