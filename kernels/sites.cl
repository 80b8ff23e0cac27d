// Sites: the lattice of points at which indirect irradiance is gathered for the pixels around (final.glsl). A
// work-item gathers LANES sites that follow one another.
#define HAS_CHARTS
#define HAS_FINAL_GATHER
#include "shim.cl"
#include "divergent_fetch.cl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/camera.glsl"
#include "shared/surface.glsl"
#include "shapes"
#include "shared/scene.glsl"
#include "shared/bsdf.glsl"
#include "shared/direct.glsl"
#include "shared/sampling.glsl"
#include "shared/texels.glsl"
#include "shared/final.glsl"
#include "shared/site.glsl"

// irradiances, surfaces: packed triples, a site each.
__kernel void sites(SCENE_PARAMS __global float *irradiances, __global float *surfaces, int count) {
    int first = (int)get_global_id(0) * LANES;
    if (first >= count) return;
    GatheredSite site = gather_site(SCENE lanes_i(first) + to_int_of(LANE_NUMBER));
    store_run(irradiances, first, count, site.irradiance);
    store_run(surfaces, first, count, site.surface);
}
