// The shared dialect's vocabulary in OpenCL C 1.2. A lane is one work-item's share of one work-item:
// LANES = 1 on GPUs; on CPUs a work-item carries 4, 8 or 16 lanes in explicit vectors, because CPU drivers do
// not vectorise across work-items (measured: 21 ms scalar, 2.3 ms with 16 lanes for the same trace).
#ifndef CONTRACTED
#pragma OPENCL FP_CONTRACT OFF
#endif

#define CONCAT_(a, b) a##b
#define CONCAT(a, b) CONCAT_(a, b)

// One for all lanes.
typedef float3 Float3;
#define triple(x, y, z) ((float3)(x, y, z))
#define STRUCT(name) typedef struct name name;

#if LANES == 1

typedef float Real;
typedef int Int;
typedef uint Uint;
typedef int Bool;
typedef float3 Vec3;
#define make3(x, y, z) ((float3)(x, y, z))
#define add3(a, b) ((a) + (b))
#define sub3(a, b) ((a) - (b))
#define mul3(a, b) ((a) * (b))
#define scale3(a, s) ((a) * (s))
#define dot3(a, b) dot(a, b)
#define cross3(a, b) cross(a, b)
#define pick3(c, a, b) ((c) ? (a) : (b))
#define any_lane(c) (c)
#define lowest(c, x) (x)
#define highest(c, x) (x)
#define highest_i(c, i) (i)
#define LANE_COLUMNS 1
#define LANE_ROWS 1
#define LANE_COLUMN 0
#define LANE_ROW 0
#define LANE_NUMBER 0u
#define INLINE
#define FETCH_U(table, i) (table)[i]
#define to_real(i) convert_float(i)
#define u_to_real(u) convert_float(u)
#define to_int(x) convert_int(x)
#define to_uint(i) as_uint(i)
#define to_int_of(u) as_int(u)
#define bits_of(x) as_uint(x)
#define from_bits(u) as_float(u)
#define NATIVE3(v) (v)

#else

// PoCL 3.1 calls functions with a stack aligned to less than its own 16-wide vectors want, and crashes: whatever
// compilers might leave as a call must not stay one.
#define INLINE __attribute__((always_inline))
typedef CONCAT(float, LANES) Real;
typedef CONCAT(int, LANES) Int;
typedef CONCAT(uint, LANES) Uint;
typedef CONCAT(int, LANES) Bool;
typedef struct { Real x, y, z; } Vec3;
Vec3 make3(Real x, Real y, Real z) { Vec3 v; v.x = x; v.y = y; v.z = z; return v; }
Vec3 add3(Vec3 a, Vec3 b) { return make3(a.x + b.x, a.y + b.y, a.z + b.z); }
Vec3 sub3(Vec3 a, Vec3 b) { return make3(a.x - b.x, a.y - b.y, a.z - b.z); }
Vec3 mul3(Vec3 a, Vec3 b) { return make3(a.x * b.x, a.y * b.y, a.z * b.z); }
Vec3 scale3(Vec3 a, Real s) { return make3(a.x * s, a.y * s, a.z * s); }
Real dot3(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec3 cross3(Vec3 a, Vec3 b) {
    return make3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
#define pick3(c, a, b) pick3_(c, a, b)
// any() is a branch for each lane on PoCL.
#if LANES == 16
int any_of(Bool c) { ulong2 bits = as_ulong2(convert_char16(c)); return (bits.x | bits.y) != 0; }
#elif LANES == 8
int any_of(Bool c) { return as_ulong(convert_char8(c)) != 0; }
#else
int any_of(Bool c) { return as_uint(convert_char4(c)) != 0; }
#endif
#define any_lane(c) any_of(c)
// A work-item's lanes are a block of pixels, row by row.
#if LANES == 4
#define LANE_COLUMNS 2
#define LANE_ROWS 2
#define LANE_COLUMN ((Int)(0, 1, 0, 1))
#define LANE_ROW ((Int)(0, 0, 1, 1))
#define LANE_NUMBER ((Uint)(0u, 1u, 2u, 3u))
#define GATHER(type, t, i) ((type)((t)[i.s0], (t)[i.s1], (t)[i.s2], (t)[i.s3]))
#elif LANES == 8
#define LANE_COLUMNS 4
#define LANE_ROWS 2
#define LANE_COLUMN ((Int)(0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_ROW ((Int)(0, 0, 0, 0, 1, 1, 1, 1))
#define LANE_NUMBER ((Uint)(0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u))
#define GATHER(type, t, i) ((type)((t)[i.s0], (t)[i.s1], (t)[i.s2], (t)[i.s3], (t)[i.s4], (t)[i.s5], (t)[i.s6], (t)[i.s7]))
#else
#define LANE_COLUMNS 4
#define LANE_ROWS 4
#define LANE_COLUMN ((Int)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_ROW ((Int)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))
#define LANE_NUMBER ((Uint)(0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u, 9u, 10u, 11u, 12u, 13u, 14u, 15u))
#define GATHER(type, t, i) \
    ((type)((t)[i.s0], (t)[i.s1], (t)[i.s2], (t)[i.s3], (t)[i.s4], (t)[i.s5], (t)[i.s6], (t)[i.s7], \
            (t)[i.s8], (t)[i.s9], (t)[i.sa], (t)[i.sb], (t)[i.sc], (t)[i.sd], (t)[i.se], (t)[i.sf]))
#endif
#define to_real(i) CONCAT(convert_float, LANES)(i)
#define u_to_real(u) CONCAT(convert_float, LANES)(u)
#define to_int(x) CONCAT(convert_int, LANES)(x)
#define to_uint(i) CONCAT(as_uint, LANES)(i)
#define to_int_of(u) CONCAT(as_int, LANES)(u)
#define bits_of(x) CONCAT(as_uint, LANES)(x)
#define from_bits(u) CONCAT(as_float, LANES)(u)
#define NATIVE3(v) make3((v).x, (v).y, (v).z)

#endif

#define count_of(x) ((int)(x)) // a uniform number that a record holds as a float
#define uint_of(x) ((uint)(x))
#define multiply_high(a, b) mul_hi(a, b)
#define lanes(x) ((Real)(x))
#define lanes_i(x) ((Int)(x))
#define lanes_u(x) ((Uint)(x))
#define NO_LANE ((Bool)(0))
#define pick(c, a, b) ((c) ? (Real)(a) : (Real)(b))
#define pick_i(c, a, b) ((c) ? (Int)(a) : (Int)(b))
#define pick_u(c, a, b) ((c) ? (Uint)(a) : (Uint)(b))
#define pick_b(c, a, b) ((c) ? (a) : (b))
#define float_of(i) ((float)(i))
#if LANES > 1
Vec3 pick3_(Bool c, Vec3 a, Vec3 b) { return make3(pick(c, a.x, b.x), pick(c, a.y, b.y), pick(c, a.z, b.z)); }
#endif

#define arctan2(y, x) atan2(y, x)
// mad() may be two instructions, and is on PoCL; fma() may be a library call where the hardware has none.
#if defined(FP_FAST_FMAF) || LANES == 16
#define multiply_add(a, b, c) fma(a, b, c)
#else
#define multiply_add(a, b, c) mad(a, b, c)
#endif

#if LANES > 1
// Least and greatest value among the lanes for which c holds; at least one does.
float lowest(Bool c, Real x) {
    x = pick(c, x, 3.0e38f);
#if LANES == 16
    float8 half16 = min(x.lo, x.hi);
    float4 half8 = min(half16.lo, half16.hi);
#elif LANES == 8
    float4 half8 = min(x.lo, x.hi);
#else
    float4 half8 = x;
#endif
    float2 half4 = min(half8.lo, half8.hi);
    return min(half4.x, half4.y);
}
float highest(Bool c, Real x) { return -lowest(c, -x); }
int highest_i(Bool c, Int x) {
    x = pick_i(c, x, -1);
#if LANES == 16
    int8 half16 = max(x.lo, x.hi);
    int4 half8 = max(half16.lo, half16.hi);
#elif LANES == 8
    int4 half8 = max(x.lo, x.hi);
#else
    int4 half8 = x;
#endif
    int2 half4 = max(half8.lo, half8.hi);
    return max(half4.x, half4.y);
}
#endif

// Tables are packed float triples (vload3: a float3* would stride 16 bytes).
#if LANES == 1
#define FETCH3_SAME(table, i, texels, t) vload3((i) * (texels) + (t), table)
#else
// Three broadcasts, which arithmetic takes straight from memory; a vload3 would be shuffled apart first.
Vec3 same3(__global const float *table, int t) { return make3(table[3 * t], table[3 * t + 1], table[3 * t + 2]); }
#define FETCH3_SAME(table, i, texels, t) same3(table, (i) * (texels) + (t))
#endif
#define FETCH3_SCALAR(table, i, texels, t) vload3((i) * (texels) + (t), table)
#define FETCH1_SCALAR(table, i, texels, t, channel) table[((i) * (texels) + (t)) * 3 + (channel)]
#define FETCH1_SAME(table, i, texels, t, channel) lanes(table[((i) * (texels) + (t)) * 3 + (channel)])
#if LANES == 1
#define FETCH3 FETCH3_SAME
#define FETCH1 FETCH1_SAME
#else
// Lanes of one work-item mostly see the same record: then one load serves all. Otherwise one load a lane, written as
// a vector literal, which compilers turn into gathers.
Vec3 fetch3(__global const float *table, Int t) {
    int first = t.s0;
    if (!any_lane(t != first)) return NATIVE3(vload3(first, table));
    Int f = t * 3;
    return make3(GATHER(Real, table, f), GATHER(Real, table + 1, f), GATHER(Real, table + 2, f));
}
Real fetch1(__global const float *table, Int f) {
    int first = f.s0;
    if (!any_lane(f != first)) return lanes(table[first]);
    return GATHER(Real, table, f);
}
Uint fetch_u(__global const uint *table, Uint i) { return GATHER(Uint, table, i); }
#define FETCH_U(table, i) fetch_u(table, i)
#define FETCH3(table, i, texels, t) fetch3(table, (i) * (texels) + (t))
#define FETCH1(table, i, texels, t, channel) fetch1(table, ((i) * (texels) + (t)) * 3 + (channel))
#endif
#define TABLE(name)
#define LIST(name)
#define ENTRY(list, i) list[i]
#define SCENE_TABLE(name, texels)
#define SCENE3 FETCH3
#define SCENE1 FETCH1
#define SCENE3_SAME FETCH3_SAME
#define SCENE1_SAME FETCH1_SAME
#define SCENE3_SCALAR FETCH3_SCALAR
#define SCENE1_SCALAR FETCH1_SCALAR
#define PARAMS(name, texels)
#define PARAM3(table, t) NATIVE3(vload3(t, table))
#define PARAM3_SCALAR(table, t) vload3(t, table)
#define PARAM1(table, t, channel) table[(t) * 3 + (channel)]

// Writes a block's pixels, those that lie in the image, as packed triples.
void store_block(__global float *film, int column, int row, int width, int height, Vec3 v) {
#if LANES == 1
    vstore3(v, row * width + column, film);
#else
    float x[LANES], y[LANES], z[LANES];
    CONCAT(vstore, LANES)(v.x, 0, x);
    CONCAT(vstore, LANES)(v.y, 0, y);
    CONCAT(vstore, LANES)(v.z, 0, z);
    int columns = min(LANE_COLUMNS, width - column), rows = min(LANE_ROWS, height - row);
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            int lane = r * LANE_COLUMNS + c;
            vstore3((float3)(x[lane], y[lane], z[lane]), (row + r) * width + column + c, film);
        }
#endif
}

// Writes the lanes' values as packed triples one after the other, from `first` on and below `end`.
void store_run(__global float *table, int first, int end, Vec3 v) {
#if LANES == 1
    if (first < end) vstore3(v, first, table);
#else
    float x[LANES], y[LANES], z[LANES];
    CONCAT(vstore, LANES)(v.x, 0, x);
    CONCAT(vstore, LANES)(v.y, 0, y);
    CONCAT(vstore, LANES)(v.z, 0, z);
    int count = min(LANES, end - first);
    for (int lane = 0; lane < count; lane++) vstore3((float3)(x[lane], y[lane], z[lane]), first + lane, table);
#endif
}

// Work-items of a group, which gather together (group.cl).
#ifdef GATHER_GROUP
#define GROUP_SIZE 64
#endif
