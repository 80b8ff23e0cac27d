// Photons into screen-space tiles: what each tile sees → (host: regions and their cells) → the regions that each
// photon's disc can touch, counted, scanned, written as pairs (cell, photon) → stable sort by cell (sort.cl) → table of
// where cells begin. Within a cell photons keep the order of their numbers: no order depends on scheduling.
#include "shim.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/camera.glsl"
#include "shared/intersect.glsl"
#include "shared/scene.glsl"
#include "shared/cell.glsl"
#include "shared/tile.glsl"

#ifdef HAS_OBJECTS
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
                Hit hit = closest_hit(SCENE frame_position(), direction, lanes_i(NO_OBJECT));
                Bool waiting = inside && hit.object >= 0;
                hit.object = pick_i(waiting, hit.object, 0);
                hit.t = pick(waiting, hit.t, 0.0f);
                Surface surface = surface_at(SCENE frame_position(), direction, hit);
                Vec3 p = surface.position;
                // As photon_radiance: these gather nothing.
                waiting = waiting && fabs(p.x) + fabs(p.y) + fabs(p.z) < 1e15f && scatters(SCENE hit.object);
                Int face = hit.object * 2 + pick_i(surface.side < 0.0f, 1, 0);
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

// Slopes, lowest and highest, of the rays that meet a disc around (across, depth) in the plane of one image axis and
// the viewing direction: the tangents from the eye, infinite where they point backwards (Mara & McGuire, "2D
// Polyhedral Bounds of a Clipped, Perspective-Projected 3D Sphere", JCGT 2013).
float2 slopes(float across, float depth, float radius) {
    float2 slope = (float2)(-1e15f, 1e15f);
    float tangent2 = across * across + depth * depth - radius * radius;
    if (tangent2 > 0.0f) {
        float tangent = sqrt(tangent2);
        float low = depth * tangent + across * radius, high = depth * tangent - across * radius;
        if (low > 0.0f) slope.x = (across * tangent - depth * radius) / low;
        if (high > 0.0f) slope.y = (across * tangent + depth * radius) / high;
    }
    // Rays round too, each along the way to its point.
    return slope + (float2)(-4e-6f, 4e-6f) * (1.0f + fabs(slope));
}

// First and last tile along an image axis of `tiles` tiles of `size` pixels that pixels from low to high can touch:
// one pixel more at either end.
int2 tile_range(float low, float high, float size, int tiles) {
    float most = (float)tiles * size;
    return (int2)((int)(clamp(low - 1.0f, 0.0f, most) / size),
                  min((int)(clamp(high + 1.0f, -1.0f, most) / size), tiles - 1) - (high < -1.0f ? 1 : 0));
}

float dot_plain(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// Calls for each region that photon i's disc can touch: counts them and, where keys are given, writes the photon's cell
// and number from `place` on.
uint enter(int i, __global const float *frame, __global const float *gather, __global const float *tiles,
           __global const float *regions, __global const float *photon_positions,
           __global const float *photon_faces, int tiles_down, __global uint *keys, __global uint *photons,
           uint place) {
    float3 p = photon_position_scalar(i);
    float3 eye = frame_position_scalar(), right = frame_right_scalar(), up = frame_up_scalar();
    float3 away = p - eye;
    // More than coordinates round, so that distances alone decide.
    float reach = gather_radius() * 1.0005f +
        4e-6f * (fabs(p.x) + fabs(p.y) + fabs(p.z) + fabs(eye.x) + fabs(eye.y) + fabs(eye.z));
    float depth = dot_plain(away, frame_forward_scalar());
    if (depth + reach <= 0.0f) return 0u;
    float half_width = sqrt(dot_plain(right, right)), half_height = sqrt(dot_plain(up, up));
    float2 across = slopes(dot_plain(away, right) / half_width, depth, reach) / half_width;
    float2 upward = slopes(dot_plain(away, up) / half_height, depth, reach) / half_height;
    float pixels = 0.5f * frame_width(), rows = 0.5f * frame_height();
    int tiles_across = count_of(gather_tiles_across());
    int2 columns = tile_range((across.x + 1.0f) * pixels, (across.y + 1.0f) * pixels, gather_tile_width(), tiles_across);
    int2 lines = tile_range((1.0f - upward.y) * rows, (1.0f - upward.x) * rows, gather_tile_height(), tiles_down);
    float face = photon_face(i);
    uint entered = 0u;
    for (int y = lines.x; y <= lines.y; y++)
        for (int x = columns.x; x <= columns.y; x++) {
            int tile = y * tiles_across + x;
            int first = count_of(tile_first_scalar(tile)), end = first + count_of(tile_count_scalar(tile));
            for (int r = first; r < end; r++) {
                if (region_face_scalar(r) != face) continue;
                float3 low = region_low_scalar(r), high = region_high_scalar(r);
                float3 gap = fmax(fmax(low - p, p - high), (float3)(0.0f));
                float size = fabs(low.x) + fabs(low.y) + fabs(low.z) + fabs(high.x) + fabs(high.y) + fabs(high.z);
                float margin = gather_radius() * 1.0005f + 5e-6f * size;
                if (dot_plain(gap, gap) > margin * margin) break; // a tile has one region a face
                if (keys) {
                    float flipped = region_flipped_scalar(r);
                    float3 inverse = grid_axes(region_inverse_cell_scalar(r), flipped);
                    float3 counts = region_counts_scalar(r);
                    float3 q = grid_axes(p, flipped) - region_origin_scalar(r);
                    int u = clamp(cell_along(q.x, inverse.x), 0, count_of(counts.x) - 1);
                    int v = clamp(cell_along(q.y, inverse.y), 0, count_of(counts.y) - 1);
                    int w = clamp(cell_along(q.z, inverse.z), 0, count_of(counts.z) - 1);
                    keys[place + entered] = row_start(count_of(region_base_scalar(r)), v, w, counts) + u;
                    photons[place + entered] = i;
                }
                entered++;
                break;
            }
        }
    return entered;
}

// counts[work-item]: pairs of a run of neighbouring photons.
__kernel void tiles_count(__global const float *frame, __global const float *gather, __global const float *tiles,
                          __global const float *regions, __global const float *photon_positions,
                          __global const float *photon_faces, int tiles_down, __global uint *counts, int count,
                          int per_item) {
    int item = get_global_id(0);
    int end = min((item + 1) * per_item, count);
    uint entered = 0u;
    for (int i = item * per_item; i < end; i++)
        // Saturated: the host refuses what is far too many.
        entered = add_sat(entered, enter(i, frame, gather, tiles, regions, photon_positions, photon_faces,
                                         tiles_down, 0, 0, 0u));
    counts[item] = entered;
}

// The pairs themselves; places are the scanned counts.
__kernel void tiles_fill(__global const float *frame, __global const float *gather, __global const float *tiles,
                         __global const float *regions, __global const float *photon_positions,
                         __global const float *photon_faces, int tiles_down, __global const uint *places,
                         int count, int per_item, __global uint *keys, __global uint *photons) {
    int item = get_global_id(0);
    int end = min((item + 1) * per_item, count);
    uint place = places[item];
    for (int i = item * per_item; i < end; i++)
        place += enter(i, frame, gather, tiles, regions, photon_positions, photon_faces, tiles_down, keys, photons,
                       place);
}

// tile_photons[i]: the photon at place i of the sorted pairs.
__kernel void tiles_photons(__global const uint *order, __global const uint *photons, __global float *tile_photons,
                            int count, int per_item) {
    int first = (int)get_global_id(0) * per_item;
    int end = min(first + per_item, count);
    for (int i = first; i < end; i++) tile_photons[i] = (float)photons[order[i]];
}
