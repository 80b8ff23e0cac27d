// One work-item traces a block of LANES pixels: square blocks keep a work-item's rays, and later its photons, close.
#include "shim.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/camera.glsl"
#include "shared/intersect.glsl"
#include "shared/scene.glsl"
#include "shared/bsdf.glsl"
#include "shared/direct.glsl"
#include "shared/kernel.glsl"
#include "shared/cell.glsl"
#include "shared/tile.glsl"
#include "shared/gather.glsl"
#include "group.cl"
#include "shared/sampling.glsl"
#include "shared/texels.glsl"
#include "shared/final.glsl"
#include "shared/pixel.glsl"

// Global size: blocks across × blocks down; film: packed RGB, row 0 = top.
__kernel void trace(SCENE_PARAMS __global float *film, int width, int height) {
    int column = (int)get_global_id(0) * LANE_COLUMNS;
    int row = (int)get_global_id(1) * LANE_ROWS;
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
