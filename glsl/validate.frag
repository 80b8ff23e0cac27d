// Reads one field of one record through the tracer's own accessors and hands out its bits.
#include "shim.glsl"
#include "layout"

uniform int field;  // which field, in the order of declaration
uniform int first;  // record that the target's first pixel stands for
uniform int stride; // records in a row of the target

out uvec4 bits;

#define FIELD3(number, value) if (field == number) return floatBitsToUint(value);
#define FIELD1(number, value) if (field == number) return uvec3(floatBitsToUint(value), 0u, 0u);

uvec3 bits_of_field(int i) {
#include "fields"
    return uvec3(0u);
}

void main() {
    bits = uvec4(bits_of_field(first + int(gl_FragCoord.y) * stride + int(gl_FragCoord.x)), 1u);
}
