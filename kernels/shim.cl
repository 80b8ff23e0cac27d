// The shared dialect's vocabulary in OpenCL C 1.2. A lane is one work-item's share of one work-item:
// LANES = 1 on GPUs; on CPUs a work-item carries 4, 8 or 16 lanes in explicit vectors, because CPU drivers do
// not vectorise across work-items (measured: 21 ms scalar, 2.3 ms with 16 lanes for the same trace).
#pragma OPENCL FP_CONTRACT OFF

#define CONCAT_(a, b) a##b
#define CONCAT(a, b) CONCAT_(a, b)

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
#define LANE_COLUMNS 1
#define LANE_ROWS 1
#define LANE_COLUMN 0
#define LANE_ROW 0
#define to_real(i) convert_float(i)
#define u_to_real(u) convert_float(u)
#define to_int(x) convert_int(x)
#define to_uint(i) as_uint(i)
#define bits_of(x) as_uint(x)
#define from_bits(u) as_float(u)
#define NATIVE3(v) (v)

#else

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
#define any_lane(c) any(c)
// A work-item's lanes are a block of pixels, row by row.
#if LANES == 4
#define LANE_COLUMNS 2
#define LANE_ROWS 2
#define LANE_COLUMN ((Int)(0, 1, 0, 1))
#define LANE_ROW ((Int)(0, 0, 1, 1))
#elif LANES == 8
#define LANE_COLUMNS 4
#define LANE_ROWS 2
#define LANE_COLUMN ((Int)(0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_ROW ((Int)(0, 0, 0, 0, 1, 1, 1, 1))
#else
#define LANE_COLUMNS 4
#define LANE_ROWS 4
#define LANE_COLUMN ((Int)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_ROW ((Int)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))
#endif
#define to_real(i) CONCAT(convert_float, LANES)(i)
#define u_to_real(u) CONCAT(convert_float, LANES)(u)
#define to_int(x) CONCAT(convert_int, LANES)(x)
#define to_uint(i) CONCAT(as_uint, LANES)(i)
#define bits_of(x) CONCAT(as_uint, LANES)(x)
#define from_bits(u) CONCAT(as_float, LANES)(u)
#define NATIVE3(v) make3((v).x, (v).y, (v).z)

#endif

#define count_of(x) ((int)(x)) // a uniform number that a record holds as a float
#define uint_of(x) ((uint)(x))
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

// Tables are packed float triples (vload3: a float3* would stride 16 bytes).
#define FETCH3_SAME(table, i, texels, t) NATIVE3(vload3((i) * (texels) + (t), table))
#define FETCH1_SAME(table, i, texels, t, channel) lanes(table[((i) * (texels) + (t)) * 3 + (channel)])
#if LANES == 1
#define FETCH3 FETCH3_SAME
#define FETCH1 FETCH1_SAME
#else
// Lanes of one work-item mostly see the same record: then one load serves all.
Vec3 fetch3(__global const float* table, Int t) {
    int first = t.s0;
    if (!any(t != first)) return NATIVE3(vload3(first, table));
    int each[LANES];
    float x[LANES], y[LANES], z[LANES];
    CONCAT(vstore, LANES)(t, 0, each);
    for (int lane = 0; lane < LANES; lane++) {
        float3 v = vload3(each[lane], table);
        x[lane] = v.x; y[lane] = v.y; z[lane] = v.z;
    }
    return make3(CONCAT(vload, LANES)(0, x), CONCAT(vload, LANES)(0, y), CONCAT(vload, LANES)(0, z));
}
Real fetch1(__global const float* table, Int f) {
    int first = f.s0;
    if (!any(f != first)) return lanes(table[first]);
    int each[LANES];
    float x[LANES];
    CONCAT(vstore, LANES)(f, 0, each);
    for (int lane = 0; lane < LANES; lane++) x[lane] = table[each[lane]];
    return CONCAT(vload, LANES)(0, x);
}
#define FETCH3(table, i, texels, t) fetch3(table, (i) * (texels) + (t))
#define FETCH1(table, i, texels, t, channel) fetch1(table, ((i) * (texels) + (t)) * 3 + (channel))
#endif
#define TABLE(name)
#define PARAMS(name, texels)
#define PARAM3(table, t) NATIVE3(vload3(t, table))
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

// What GLSL holds as globals is passed along.
#define SCENE_PARAMS __global const float *frame, __global const float *objects, __global const float *lights,
#define SCENE frame, objects, lights,

#define STRUCT(name) typedef struct name name; struct name
#define EMISSION_PARAMS __global const float *emitters, __global const uint *emitter_counts, \
    __global const uint *slots, __global const uint *emission_cells,
#define EMISSION emitters, emitter_counts, slots, emission_cells,
#define to_int_bits(u) as_int(u)
#define multiply_high(a, b) mul_hi(a, b)
#if LANES == 1
#define LANE_NUMBER 0u
#define FETCH_U(table, i) (table)[i]
#define STORE_RUNS(table, first, count, v) (table)[first] = (v)
#define LOAD_RUNS(table, first, count) (table)[first]
#define store_lanes(mask, slot, table, v) if (mask) vstore3(v, slot, table)
#define store_photons(mask, slot, ta, a, tb, b, tc, c) if (mask) { vstore3(a, slot, ta); vstore3(b, slot, tb); vstore3(c, slot, tc); }
#else
#if LANES == 4
#define LANE_NUMBER ((Uint)(0u, 1u, 2u, 3u))
#elif LANES == 8
#define LANE_NUMBER ((Uint)(0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u))
#else
#define LANE_NUMBER ((Uint)(0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u, 9u, 10u, 11u, 12u, 13u, 14u, 15u))
#endif
Uint fetch_u(__global const uint *table, Uint i) {
    uint each[LANES], v[LANES];
    CONCAT(vstore, LANES)(i, 0, each);
    for (int lane = 0; lane < LANES; lane++) v[lane] = table[each[lane]];
    return CONCAT(vload, LANES)(0, v);
}
#define FETCH_U fetch_u
// tables of runs are padded to whole work-items
#define STORE_RUNS(table, first, count, v) CONCAT(vstore, LANES)(v, 0, (table) + (first))
#define LOAD_RUNS(table, first, count) CONCAT(vload, LANES)(0, (table) + (first))
void store_lanes(Bool mask, Uint slot, __global float *table, Vec3 v) {
    float x[LANES], y[LANES], z[LANES]; uint s[LANES]; int m[LANES];
    CONCAT(vstore, LANES)(v.x, 0, x); CONCAT(vstore, LANES)(v.y, 0, y); CONCAT(vstore, LANES)(v.z, 0, z);
    CONCAT(vstore, LANES)(slot, 0, s); CONCAT(vstore, LANES)(mask, 0, m);
    for (int lane = 0; lane < LANES; lane++) if (m[lane]) vstore3((float3)(x[lane], y[lane], z[lane]), s[lane], table);
}
#define store_photons(mask, slot, ta, a, tb, b, tc, c) { store_lanes(mask, slot, ta, a); store_lanes(mask, slot, tb, b); store_lanes(mask, slot, tc, c); }
#endif
