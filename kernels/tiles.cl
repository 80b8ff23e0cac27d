// Photons into screen-space tiles: what each tile sees → (host: regions and their cells) → the regions that each
// photon's disc can touch, counted, scanned, written as pairs (cell, photon) → stable sort by cell (sort.cl) → table of
// where cells begin. Within a cell photons keep the order of their numbers: no order depends on scheduling.
#include "shim.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/camera.glsl"
#include "shared/surface.glsl"
#include "shapes"
#include "shared/scene.glsl"
#include "shared/cell.glsl"
#include "shared/tile.glsl"

#ifdef HAS_SHAPES
// Floats of a strip's slot: face, lowest x, y, z, highest x, y, z.
#define SLOT 7

// Boxes of what strips see, face by face: a strip is a part of a tile, a work-item's share. seen[strip] has `slots`
// slots, of which counts[strip] are used; a strip that sees more faces says so by a larger count, and loses them. The
// rays are the very ones that the tracer follows.
__kernel void tiles_seen(SCENE_PARAMS __global float *seen, __global uint *counts, int tile_width, int tile_height,
                         int tiles_across, int tile_count, int strip_width, int strip_height, int slots) {
    int strips_across = (tile_width + strip_width - 1) / strip_width;
    int strips_down = (tile_height + strip_height - 1) / strip_height;
    int strip = get_global_id(0);
    int tile = strip / (strips_across * strips_down);
    if (tile >= tile_count) return;
    int within = strip % (strips_across * strips_down);
    // Pixels from (left, top) to before (right, bottom): inside the strip, its tile and the image.
    int left = tile % tiles_across * tile_width, top = tile / tiles_across * tile_height;
    int right = min(left + tile_width, (int)frame_width()), bottom = min(top + tile_height, (int)frame_height());
    left += within % strips_across * strip_width;
    top += within / strips_across * strip_height;
    right = min(right, left + strip_width);
    bottom = min(bottom, top + strip_height);
    __global float *own_seen = seen + strip * slots * SLOT;
    uint used = 0u, last = 0u;
#ifdef ONE_SAMPLE
    int samples = 1;
#else
    int samples = count_of(frame_samples());
#endif
    for (int y = top; y < bottom; y += LANE_ROWS)
        for (int x = left; x < right; x += LANE_COLUMNS) {
            Int column = lanes_i(x) + LANE_COLUMN, row = lanes_i(y) + LANE_ROW;
            Bool inside = column < right && row < bottom;
            for (int s = 0; s < samples; s++) {
                Vec3 direction = sample_direction(SCENE column, row, s);
                Hit hit = closest_hit(SCENE frame_position(), direction, lanes_i(NO_FACE));
                Bool waiting = inside && hit.shape >= 0;
                hit.shape = pick_i(waiting, hit.shape, 0);
                hit.t = pick(waiting, hit.t, 0.0f);
                Surface surface = surface_at(SCENE frame_position(), direction, hit);
                Vec3 p = surface.position;
                // As photon_radiance: these gather nothing.
                waiting = waiting && fabs(p.x) + fabs(p.y) + fabs(p.z) < 1e15f && scatters(SCENE hit.shape);
                Int face = face_left(surface);
                while (any_lane(waiting)) {
                    int chosen = highest_i(waiting, face);
                    Bool own = waiting && face == chosen;
                    waiting = waiting && !own;
                    // Mostly the face that the last ray hit.
                    uint slot = last;
                    if (slot >= used || own_seen[slot * SLOT] != (float)chosen) {
                        slot = 0u;
                        while (slot < used && slot < (uint)slots && own_seen[slot * SLOT] != (float)chosen) slot++;
                    }
                    if (slot >= (uint)slots) {
                        used = slots + 1;
                        continue;
                    }
                    __global float *box = own_seen + slot * SLOT;
                    last = slot;
                    if (slot == used) {
                        used++;
                        box[0] = chosen;
                        box[1] = box[2] = box[3] = INFINITE;
                        box[4] = box[5] = box[6] = -INFINITE;
                    }
                    box[1] = min(box[1], (float)lowest(own, p.x));
                    box[2] = min(box[2], (float)lowest(own, p.y));
                    box[3] = min(box[3], (float)lowest(own, p.z));
                    box[4] = max(box[4], (float)highest(own, p.x));
                    box[5] = max(box[5], (float)highest(own, p.y));
                    box[6] = max(box[6], (float)highest(own, p.z));
                }
            }
        }
    counts[strip] = used;
}
#endif

float dot_plain(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

STRUCT(Slopes)
struct Slopes {
    Real low, high;
};

// Slopes, lowest and highest, of the rays that meet a disc around (across, depth) in the plane of one image axis and
// the viewing direction: the tangents from the eye, infinite where they point backwards (Mara & McGuire, "2D
// Polyhedral Bounds of a Clipped, Perspective-Projected 3D Sphere", JCGT 2013).
INLINE Slopes slopes(Real across, Real depth, Real radius) {
    Real tangent2 = across * across + depth * depth - radius * radius;
    Bool outside = tangent2 > 0.0f;
    Real tangent = sqrt(max(tangent2, lanes(0.0f)));
    Real low = depth * tangent + across * radius, high = depth * tangent - across * radius;
    Slopes s;
    s.low = pick(outside && low > 0.0f, (across * tangent - depth * radius) / low, -1e15f);
    s.high = pick(outside && high > 0.0f, (across * tangent + depth * radius) / high, 1e15f);
    // Rays round too, each along the way to its point.
    s.low = s.low - 4e-6f * (1.0f + fabs(s.low));
    s.high = s.high + 4e-6f * (1.0f + fabs(s.high));
    return s;
}

// First and last tile along an image axis of `tiles` tiles of `size` pixels that pixels from low to high can touch:
// one pixel more at either end.
INLINE Int first_tile(Real low, float size, int tiles) {
    return to_int(min(max(low - 1.0f, lanes(0.0f)), lanes((float)tiles * size)) / size);
}
INLINE Int last_tile(Real high, float size, int tiles) {
    Int last = to_int(min(max(high + 1.0f, lanes(-1.0f)), lanes((float)tiles * size)) / size);
    return min(last, lanes_i(tiles - 1)) - pick_i(high < -1.0f, 1, 0);
}

// Lanes' values as an array.
#if LANES == 1
#define TO_ARRAY(v, array) array[0] = v
#else
#define TO_ARRAY(v, array) CONCAT(vstore, LANES)(v, 0, array)
#endif

// What a photon enters, in four words: the numbers of up to four regions, NO_REGION after the last one; or MANY, and the
// rectangle of tiles to go through once more, left | top << 16 and right | bottom << 16.
#define NO_REGION 0xffffffffu
#define MANY 0xfffffffeu

// The first photon's and its neighbours' rectangles of tiles, a lane each: left, top, right, bottom, all of them inside;
// right before left where a disc meets no ray. Photons from `end` on are the last one once more.
INLINE void spans_of(int first, int end, __global const float *frame, __global const float *gather,
                     __global const float *photon_positions, int tiles_down, int *left, int *top, int *right_end,
                     int *bottom) {
    Int photon = min(lanes_i(first) + to_int_of(LANE_NUMBER), lanes_i(end - 1));
    Vec3 p = photon_position(photon);
    float3 eye = frame_position_scalar(), right = frame_right_scalar(), up = frame_up_scalar();
    float3 forward = frame_forward_scalar();
    Real x = p.x - eye.x, y = p.y - eye.y, z = p.z - eye.z;
    // More than coordinates round, so that distances alone decide.
    Real reach = gather_radius() * 1.0005f +
        4e-6f * (fabs(p.x) + fabs(p.y) + fabs(p.z) + fabs(eye.x) + fabs(eye.y) + fabs(eye.z));
    Real depth = x * forward.x + y * forward.y + z * forward.z;
    float half_width = sqrt(dot_plain(right, right)), half_height = sqrt(dot_plain(up, up));
    Slopes across = slopes((x * right.x + y * right.y + z * right.z) / half_width, depth, reach);
    Slopes upward = slopes((x * up.x + y * up.y + z * up.z) / half_height, depth, reach);
    float pixels = 0.5f * frame_width(), rows = 0.5f * frame_height();
    int tiles_across = count_of(gather_tiles_across());
    Int x_first = first_tile((across.low / half_width + 1.0f) * pixels, gather_tile_width(), tiles_across);
    Int x_last = last_tile((across.high / half_width + 1.0f) * pixels, gather_tile_width(), tiles_across);
    Int y_first = first_tile((1.0f - upward.high / half_height) * rows, gather_tile_height(), tiles_down);
    Int y_last = last_tile((1.0f - upward.low / half_height) * rows, gather_tile_height(), tiles_down);
    TO_ARRAY(x_first, left);
    TO_ARRAY(y_first, top);
    TO_ARRAY(pick_i(depth + reach > 0.0f, x_last, -1), right_end);
    TO_ARRAY(y_last, bottom);
}

// A walk through the regions of one face in a rectangle of tiles, row by row (tiling/lines.rs): `slot` is the face's among
// those that are seen, `at` and `end` are entries of the row.
struct Walk {
    int slot, left, right, row, bottom, at, end;
};

// Goes to the walk's row: the first entry there whose column is not left of the rectangle. Columns grow by one from entry
// to entry, or by more where something else stands between: the place is where it would be by ones, or before.
INLINE void enter_row(struct Walk *walk, int tiles_down, __global const uint *starts, __global const uint *columns) {
    int line = walk->slot * tiles_down + walk->row;
    int first = (int)starts[line], end = (int)starts[line + 1];
    int at = first < end ? clamp(first + walk->left - (int)columns[first], first, end) : first;
    while (at > first && (int)columns[at - 1] >= walk->left) at--;
    walk->at = at;
    walk->end = end;
}

INLINE struct Walk walk_of(int slot, int left, int top, int right, int bottom, int tiles_down,
                           __global const uint *starts, __global const uint *columns) {
    struct Walk walk = {slot, left, right, top, bottom, 0, 0};
    if (slot < 0 || right < left) walk.bottom = -1;
    if (walk.row <= walk.bottom) enter_row(&walk, tiles_down, starts, columns);
    return walk;
}

// The next region that a photon's disc can touch, −1 after the last one.
INLINE int next_region(struct Walk *walk, float3 p, int tiles_down, __global const uint *starts,
                       __global const uint *columns, __global const float *boxes) {
    while (walk->row <= walk->bottom) {
        while (walk->at < walk->end && (int)columns[walk->at] <= walk->right) {
            float8 box = vload8(walk->at++, boxes);
            float3 gap = max(max(box.s012 - p, p - box.s456), (float3)(0.0f));
            if (dot_plain(gap, gap) <= box.s3) return (int)box.s7;
        }
        if (++walk->row <= walk->bottom) enter_row(walk, tiles_down, starts, columns);
    }
    return -1;
}

// counts[work-item]: pairs of a run of neighbouring photons; entered[photon]: what each of them enters.
__kernel void tiles_count(__global const float *frame, __global const float *gather,
                          __global const float *photon_positions, __global const float *photon_faces, int tiles_down,
                          __global const int *slots, __global const uint *starts, __global const uint *columns,
                          __global const float *boxes, int count, int per_item, __global uint *counts,
                          __global uint *entered) {
    int item = get_global_id(0);
    int end = min((item + 1) * per_item, count);
    uint sum = 0u;
    int left[LANES], top[LANES], right[LANES], bottom[LANES];
    for (int block = item * per_item; block < end; block += LANES) {
        spans_of(block, end, frame, gather, photon_positions, tiles_down, left, top, right, bottom);
        for (int lane = 0; lane < min(LANES, end - block); lane++) {
            int i = block + lane;
            float3 p = photon_position_scalar(i);
            struct Walk walk = walk_of(slots[(int)photon_face(i)], left[lane], top[lane], right[lane], bottom[lane],
                                       tiles_down, starts, columns);
            uint4 own = (uint4)(NO_REGION);
            uint found = 0u;
            for (int r; (r = next_region(&walk, p, tiles_down, starts, columns, boxes)) >= 0; found++) {
                if (found == 0u) own.x = r;
                if (found == 1u) own.y = r;
                if (found == 2u) own.z = r;
                if (found == 3u) own.w = r;
            }
            if (found > 4u)
                own = (uint4)(MANY, left[lane] | (top[lane] << 16), right[lane] | (bottom[lane] << 16), 0u);
            // Saturated: the host refuses what is far too many.
            sum = add_sat(sum, found);
            vstore4(own, i, entered);
        }
    }
    counts[item] = sum;
}

// The pairs themselves; places are the scanned counts. Where regions have no cells (`celled` = 0) each of them is one.
__kernel void tiles_fill(__global const float *regions, __global const float *photon_positions,
                         __global const float *photon_faces, int tiles_down, __global const int *slots,
                         __global const uint *starts, __global const uint *columns, __global const float *boxes,
                         int count, int per_item, __global const uint *places, __global const uint *entered,
                         int celled, __global uint *keys, __global uint *photons) {
    int item = get_global_id(0);
    int end = min((item + 1) * per_item, count);
    uint place = places[item];
    for (int i = item * per_item; i < end; i++) {
        uint4 own = vload4(i, entered);
        if (own.x == NO_REGION) continue;
        float3 p = photon_position_scalar(i);
        bool many = own.x == MANY;
        struct Walk walk = {-1, 0, 0, 0, -1, 0, 0};
        if (many)
            walk = walk_of(slots[(int)photon_face(i)], own.y & 0xffffu, own.y >> 16, own.z & 0xffffu, own.z >> 16,
                           tiles_down, starts, columns);
        while (true) {
            int r = many ? next_region(&walk, p, tiles_down, starts, columns, boxes) : (int)own.x;
            if (r < 0) break;
            own = (uint4)(own.yzw, NO_REGION);
            photons[place] = i;
            if (!celled) {
                keys[place++] = r;
                continue;
            }
            float flipped = region_flipped_scalar(r);
            float3 inverse = grid_axes(region_inverse_cell_scalar(r), flipped);
            float3 counts = region_counts_scalar(r);
            float3 q = grid_axes(p, flipped) - region_origin_scalar(r);
            int u = clamp(cell_along(q.x, inverse.x), 0, count_of(counts.x) - 1);
            int v = clamp(cell_along(q.y, inverse.y), 0, count_of(counts.y) - 1);
            int w = clamp(cell_along(q.z, inverse.z), 0, count_of(counts.z) - 1);
            keys[place++] = row_start(count_of(region_base_scalar(r)), v, w, counts) + u;
        }
    }
}

// tile_photons[i]: the photon at place i of the sorted pairs.
__kernel void tiles_photons(__global const uint *order, __global const uint *photons, __global float *tile_photons,
                            int count, int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, count);
    for (int i = first; i < end; i++) tile_photons[i] = (float)photons[order[i]];
}
