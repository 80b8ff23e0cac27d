// Runs one of the stress suites' bodies (shared/stress.glsl) for each fragment; a draw hands out four of eight words.
#include "shim.glsl"
#include "layout"
#include "shared/vector.glsl"
#include "shared/random.glsl"
#include "shared/sampling.glsl"
#include "shared/surface.glsl"
#include "shapes"
#include "shared/faults.glsl"
#include "shared/scene.glsl"
TABLE(cases)
#include "shared/stress.glsl"

uniform int first;  // item that the target's first pixel stands for
uniform int count;  // items of this draw
uniform int stride; // items in a row of the target
uniform int part;   // 0: words a to d; 1: e to h

out uvec4 words;

void main() {
    int item = min(int(gl_FragCoord.y) * stride + int(gl_FragCoord.x), count - 1);
    Answer answer = stress(first + item);
    words = part == 0 ? uvec4(answer.a, answer.b, answer.c, answer.d) : uvec4(answer.e, answer.f, answer.g, answer.h);
}
