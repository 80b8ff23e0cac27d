// One work-item traces a block of LANES pixels: square blocks keep a work-item's rays, and later its photons, close.
#include "shim.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/camera.glsl"
#include "shared/surface.glsl"
#include "shared/kernel.glsl"
#include "shapes"
#include "shared/scene.glsl"
#include "shared/bsdf.glsl"
#include "shared/direct.glsl"
#include "shared/disc.glsl"
#include "shared/cell.glsl"
#include "shared/tile.glsl"
#include "shared/gather.glsl"
#include "group.cl"
#include "shared/sampling.glsl"
#include "shared/texels.glsl"
#include "shared/final.glsl"
#include "shared/pixel.glsl"

// Global size: blocks across × blocks down, in `bands` of BAND rows of blocks; film: packed RGB, row 0 = top. A launch may
// be cut: band after band is taken in steps of `stride`, so that each piece has bands from all over the picture.
#define BAND 8
__kernel void trace(SCENE_PARAMS __global float *film, int width, int height, int bands, int stride) {
    int down = get_global_id(1);
    int band = down / BAND * stride % bands;
    int column = (int)get_global_id(0) * LANE_COLUMNS;
    int row = (band * BAND + down % BAND) * LANE_ROWS;
#ifdef GATHER_GROUP
    // Items beyond the image help its last pixels' group along.
    Vec3 radiance = pixel_radiance(SCENE min(column, width - 1), min(row, height - 1));
    if (column < width && row < height) store_block(film, column, row, width, height, radiance);
#else
    if (column >= width || row >= height) return;
    Vec3 radiance = pixel_radiance(SCENE lanes_i(column) + LANE_COLUMN, lanes_i(row) + LANE_ROW);
    store_block(film, column, row, width, height, radiance);
#endif
}

#if defined(SLICED) || defined(PARTS)
// Adds a part to the film, or begins with it.
__kernel void trace_add(__global const float *part, __global float *film, int count, float weight, int is_first) {
    int i = get_global_id(0);
    if (i < count) film[i] = is_first ? weight * part[i] : film[i] + weight * part[i];
}
#endif
