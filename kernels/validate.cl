// Reads one field of each record through the tracer's own accessors and hands out its bits.
#include "shim.cl"
#include "layout"

#if LANES == 1
#define LANE_ID 0
#define LANE_BITS(value, lane) as_uint(value)
#else
// Lanes ask for neighbouring records, so that every lane has another.
#define LANE_ID (LANE_ROW * LANE_COLUMNS + LANE_COLUMN)
uint lane_bits(Real value, int lane) {
    uint each[LANES];
    CONCAT(vstore, LANES)(bits_of(value), 0, each);
    return each[lane];
}
#define LANE_BITS lane_bits
#endif

void put3(__global uint *bits, int record, Vec3 value, int lane) {
    bits[record * 3] = LANE_BITS(value.x, lane);
    bits[record * 3 + 1] = LANE_BITS(value.y, lane);
    bits[record * 3 + 2] = LANE_BITS(value.z, lane);
}

// Global size: ceil(count / LANES); bits: three words a record, from record `first` on.
__kernel void validate_each(__global const float *VALIDATED, __global uint *bits, int field, int first, int count) {
    int base = (int)get_global_id(0) * LANES;
    // Lanes past the end read the last record: reading beyond the table is nobody's right.
    Int i = min(lanes_i(base) + LANE_ID, lanes_i(count - 1)) + first;
    for (int lane = 0; lane < LANES; lane++) {
        int record = base + lane;
        if (record >= count) break;
#define FIELD3(number, value) if (field == number) put3(bits, record, value, lane);
#define FIELD1(number, value) if (field == number) bits[record * 3] = LANE_BITS(value, lane);
#include "fields"
    }
}

// The same through the accessors that load one record for all lanes. Global size: count.
__kernel void validate_same(__global const float *VALIDATED, __global uint *bits, int field, int first, int count) {
    int record = (int)get_global_id(0);
    if (record >= count) return;
    int i = first + record;
    int lane = LANES - 1;
#include "fields same"
}
