// Sites: a fragment gathers one site of the lattice (final.glsl); sites fill rows of a table's width.
#define HAS_CHARTS
#define HAS_FINAL_GATHER
#include "shim.glsl"
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

layout(location = 0) out vec4 irradiance;
layout(location = 1) out vec4 seen;

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    GatheredSite site = gather_site((place.y << TEXTURE_WIDTH_LOG2) + place.x);
    irradiance = vec4(site.irradiance, 1.0);
    seen = vec4(site.surface, 1.0);
}
