// Stable radix sort of (key, value) pairs by DIGIT_BITS of the key a pass, least significant digit first:
// sort_count → exclusive scan → sort_scatter. Every work-item owns one run of neighbouring pairs and keeps its
// counters to itself: no atomics, no barriers, and the order does not depend on scheduling.
// Knuth, TAOCP 3, §5.2.5; Zagha & Blelloch, "Radix Sort for Vector Multiprocessors", SC 1991.
#define DIGITS (1 << DIGIT_BITS)
#define DIGIT(key) (((key) >> shift) & (DIGITS - 1))

// counts[digit][work-item]: so that a scan of the whole yields each work-item's first place for each digit.
__kernel void sort_count(__global const uint *keys, __global uint *counts, int count, int per_item, int shift,
                         int items) {
    uint own[DIGITS];
    for (int d = 0; d < DIGITS; d++) own[d] = 0u;
    int item = get_global_id(0);
    if (item >= items) return;
    int end = min((item + 1) * per_item, count);
    for (int i = item * per_item; i < end; i++) own[DIGIT(keys[i])]++;
    for (int d = 0; d < DIGITS; d++) counts[d * items + item] = own[d];
}

// Places are the scanned counts. In the first pass (`numbers` = 1) a value is the pair's own number.
__kernel void sort_scatter(__global const uint *keys, __global const uint *values, __global const uint *places,
                           __global uint *sorted_keys, __global uint *sorted_values, int count, int per_item,
                           int shift, int numbers, int items) {
    uint next[DIGITS];
    int item = get_global_id(0);
    if (item >= items) return;
    for (int d = 0; d < DIGITS; d++) next[d] = places[d * items + item];
    int end = min((item + 1) * per_item, count);
    for (int i = item * per_item; i < end; i++) {
        uint key = keys[i];
        uint place = next[DIGIT(key)]++;
        sorted_keys[place] = key;
        sorted_values[place] = numbers ? (uint)i : values[i];
    }
}
