// Full-screen quad: every fragment unpacks the scene, traces and shades its pixel.
#include "shim.glsl"
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
#include "shared/sampling.glsl"
#include "shared/texels.glsl"
#include "shared/final.glsl"
#include "shared/pixel.glsl"

out vec4 film;

void main() {
    // Row 0 is the image's top and the framebuffer's first row: read back without a flip.
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    film = vec4(pixel_radiance(pixel.x, pixel.y), 1.0);
}
