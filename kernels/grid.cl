// Photons sorted into the grid's cells: bounds of each face → cell of each photon → stable radix sort → table of
// where cells begin → photons in that order. Within a cell photons keep the order of their numbers, because the sort
// is stable: the same photons give the same bytes on any device. Work-items own runs of neighbouring photons.
#include "shim.cl"
#include "layout"
#include "shared/cell.glsl"

// Floats as ints that compare alike, and back: OpenCL 1.2 has no atomics on floats.
int ordered(float x) {
    int i = as_int(x);
    return i ^ ((i >> 31) & 0x7fffffff);
}

// Widens a face's bounds, in any memory. Looking first spares nearly all atomics; a stale value costs one more of them,
// never a wrong bound.
#define WIDEN(own, low_x, low_y, low_z, high_x, high_y, high_z) \
    do { \
        if (low_x < own[0]) atomic_min(own + 0, low_x); \
        if (low_y < own[1]) atomic_min(own + 1, low_y); \
        if (low_z < own[2]) atomic_min(own + 2, low_z); \
        if (high_x > own[3]) atomic_max(own + 3, high_x); \
        if (high_y > own[4]) atomic_max(own + 4, high_y); \
        if (high_z > own[5]) atomic_max(own + 5, high_z); \
    } while (false)

// Widens bounds[face], as lowest x, y, z and highest x, y, z of ordered ints.
#ifndef BOUNDS_GROUP
#define BOUNDS_GROUP 1
#endif
#if BOUNDS_GROUP == 1
__kernel void grid_bounds(__global const float *photon_positions, __global const float *photon_faces,
                          __global volatile int *bounds, int faces, int count, int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, count);
    for (int i = first; i < end; i++) {
        __global volatile int *own = bounds + 6 * (int)photon_face(i);
        float3 p = photon_position_scalar(i);
        int x = ordered(p.x), y = ordered(p.y), z = ordered(p.z);
        WIDEN(own, x, y, z, x, y, z);
    }
}
#else
// The same by work-groups of a GPU, in local memory first where that has room for all faces.
__kernel __attribute__((reqd_work_group_size(BOUNDS_GROUP, 1, 1)))
void grid_bounds(__global const float *photon_positions, __global const float *photon_faces,
                 __global volatile int *bounds, int faces, int count, int per_item) {
    __local volatile int near[6 * BOUNDS_FACES];
    int item = get_local_id(0);
    bool fits = faces <= BOUNDS_FACES;
    for (int i = item; fits && i < 6 * faces; i += BOUNDS_GROUP) near[i] = i % 6 < 3 ? INT_MAX : INT_MIN;
    barrier(CLK_LOCAL_MEM_FENCE);
    int first = (int)get_global_id(0) / BOUNDS_GROUP * BOUNDS_GROUP * per_item;
    int end = min(first + BOUNDS_GROUP * per_item, count);
    for (int i = first + item; i < end; i += BOUNDS_GROUP) {
        int face = 6 * (int)photon_face(i);
        float3 p = photon_position_scalar(i);
        int x = ordered(p.x), y = ordered(p.y), z = ordered(p.z);
        if (fits) WIDEN((near + face), x, y, z, x, y, z);
        else WIDEN((bounds + face), x, y, z, x, y, z);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int face = item; fits && face < faces; face += BOUNDS_GROUP) {
        __global volatile int *own = bounds + 6 * face;
        __local volatile int *group = near + 6 * face;
        WIDEN(own, group[0], group[1], group[2], group[3], group[4], group[5]);
    }
}
#endif

// Number of each photon's cell.
__kernel void grid_keys(__global const float *photon_positions, __global const float *photon_faces,
                        __global const float *faces, __global const float *gather, __global uint *keys,
                        int count, int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, count);
    for (int i = first; i < end; i++) {
        int face = (int)photon_face(i);
        float flipped = face_flipped_scalar(face);
        float3 inverse = cell_axes(gather_inverse_cell_scalar(), flipped, gather_by_rows());
        float3 p = grid_axes(photon_position_scalar(i), flipped) - face_origin_scalar(face);
        int u = cell_along(p.x, inverse.x), v = cell_along(p.y, inverse.y), w = cell_along(p.z, inverse.z);
#ifdef GRID_HASHED
        int bucket = (row_start((int)face_base_scalar(face), v, w) + u) & (int)gather_bucket_mask();
        keys[i] = (int)face_table_scalar(face) + bucket;
#else
        keys[i] = row_start((int)face_base_scalar(face), v, w, face_counts_scalar(face)) + u;
#endif
    }
}

// cell_starts[c] is the first photon of cell c, for c = 0 … cells: a cell ends where the next one begins. Each photon
// fills the cells between its predecessor's and its own; the last entry belongs to item `count`.
__kernel void grid_starts(__global const uint *sorted_keys, __global float *cell_starts, int count, int cells,
                          int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, count + 1);
    for (int i = first; i < end; i++) {
        int before = i == 0 ? -1 : (int)sorted_keys[i - 1];
        int own = i == count ? cells : (int)sorted_keys[i];
        for (int c = before + 1; c <= own; c++) cell_starts[c] = (float)i;
    }
}

// The most photons of any cell: how long the longest query may be.
__kernel void grid_fullest(__global const float *cell_starts, __global volatile uint *fullest, int cells, int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, cells);
    uint most = 0u;
    for (int c = first; c < end; c++) most = max(most, (uint)(cell_starts[c + 1] - cell_starts[c]));
    if (most > *fullest) atomic_max(fullest, most);
}

// to[i] = from[order[i]], for tables of one texel a photon.
__kernel void grid_reorder(__global const uint *order, __global const float *from, __global float *to, int count,
                           int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, count);
    for (int i = first; i < end; i++) vstore3(vload3(order[i], from), i, to);
}

// The other way: to[order[i]] = from[i]. Undoes grid_reorder.
__kernel void grid_restore(__global const uint *order, __global const float *from, __global float *to, int count,
                           int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, count);
    for (int i = first; i < end; i++) vstore3(vload3(i, from), order[i], to);
}
