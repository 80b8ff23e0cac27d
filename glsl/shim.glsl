// The shared dialect's vocabulary in GLSL 3.30: a "lane" is one fragment, so lane types are the plain ones.
#define Real float
#define Int int
#define Uint uint
#define Bool bool
#define Vec3 vec3
#define LANES 1
#define INLINE
#define STRUCT(name) // a struct's name is a type already
#define lanes(x) float(x)
#define lanes_i(x) int(x)
#define lanes_u(x) uint(x)
#define make3(x, y, z) vec3(x, y, z)
#define Float3 vec3
#define triple(x, y, z) vec3(x, y, z)
#define add3(a, b) ((a) + (b))
#define sub3(a, b) ((a) - (b))
#define mul3(a, b) ((a) * (b))
#define scale3(a, s) ((a) * (s))
#define dot3(a, b) dot(a, b)
#define cross3(a, b) cross(a, b)
#define pick(c, a, b) ((c) ? (a) : (b))
#define pick_i(c, a, b) ((c) ? (a) : (b))
#define pick_u(c, a, b) ((c) ? (a) : (b))
#define pick_b(c, a, b) ((c) ? (a) : (b))
#define pick3(c, a, b) ((c) ? (a) : (b))
#define any_lane(c) (c)
#define lowest(c, x) (x)
#define highest(c, x) (x)
#define highest_i(c, i) (i)
#define NO_LANE false
#define fabs abs
#define arctan2(y, x) atan(y, x)
#define multiply_add(a, b, c) ((a) * (b) + (c))
#define to_real(i) float(i)
#define u_to_real(u) float(u)
#define to_int(x) int(x)
#define to_uint(i) uint(i)
#define float_of(i) float(i)
#define count_of(x) int(x)
#define uint_of(x) uint(x)
#define bits_of(x) floatBitsToUint(x)
#define from_bits(u) uintBitsToFloat(u)

float copysign(float magnitude, float sign_of) {
    return uintBitsToFloat((floatBitsToUint(magnitude) & 0x7fffffffu) | (floatBitsToUint(sign_of) & 0x80000000u));
}

// Tables are RGB32F textures whose records wrap into rows of a power-of-two width (layout.rs).
#define COLUMN(t) ((t) & (TEXTURE_WIDTH - 1))
#define ROW(t) ((t) >> TEXTURE_WIDTH_LOG2)
#ifdef SAMPLED
// The same texel through the sampler: GL_NEAREST at the texel's exact centre. Llvmpipe takes half the time for it: where a
// texel is fetched by integers it works out sizes and strides of the level for every lane.
#define TEXEL(table, t) texture(table, vec2(float(COLUMN(t)), float(ROW(t))) + 0.5).xyz
#else
#define TEXEL(table, t) texelFetch(table, ivec2(COLUMN(t), ROW(t))).xyz
#endif
#define TABLE(name) uniform sampler2DRect name;
#define FETCH3(table, i, texels, t) TEXEL(table, (i) * (texels) + (t))
#define FETCH1(table, i, texels, t, channel) TEXEL(table, (i) * (texels) + (t))[channel]
// One record for all lanes: in GLSL every fetch is a lane's own.
#define FETCH3_SAME FETCH3
#define FETCH1_SAME FETCH1
#define FETCH3_SCALAR FETCH3
#define FETCH1_SCALAR FETCH1
// A plain list of numbers, three to a texel.
#define LIST(name) uniform sampler2DRect name;
#define ENTRY(list, i) TEXEL(list, (i) / 3)[(i) % 3]
// Small scenes are uniforms (layout.rs says how small).
#ifdef SCENE_IN_UNIFORMS
#define SCENE_TABLE(name, texels) uniform vec3 name[texels];
#define SCENE3(table, i, texels, t) table[(i) * (texels) + (t)]
#define SCENE1(table, i, texels, t, channel) table[(i) * (texels) + (t)][channel]
#else
#define SCENE_TABLE(name, texels) TABLE(name)
#define SCENE3 FETCH3
#define SCENE1 FETCH1
#endif
#define SCENE3_SAME SCENE3
#define SCENE1_SAME SCENE1
#define SCENE3_SCALAR SCENE3
#define SCENE1_SCALAR SCENE1
#define PARAMS(name, texels) uniform vec3 name[texels];
#define PARAM3(table, t) table[t]
#define PARAM3_SCALAR PARAM3
#define PARAM1(table, t, channel) table[t][channel]
