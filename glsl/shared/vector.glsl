// Small vector helpers that every other file uses.

#define INFINITE 3.0e38f // farther than any hit; finite, so that 0 · INFINITE stays a number

Vec3 negate3(Vec3 v) { return scale3(v, lanes(-1.0f)); }

Vec3 normalize3(Vec3 v) { return scale3(v, 1.0f / sqrt(dot3(v, v))); }

// Fused where the device can: for sums whose order is not fixed anyway.
Real square3(Vec3 v) { return multiply_add(v.x, v.x, multiply_add(v.y, v.y, v.z * v.z)); }

Vec3 scale_add3(Vec3 v, Real s, Vec3 sum) {
    return make3(multiply_add(v.x, s, sum.x), multiply_add(v.y, s, sum.y), multiply_add(v.z, s, sum.z));
}
