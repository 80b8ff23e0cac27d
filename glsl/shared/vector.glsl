// Small vector helpers that every other file uses.

#define INFINITE 3.0e38f // farther than any hit; finite, so that 0 · INFINITE stays a number

Vec3 negate3(Vec3 v) { return scale3(v, lanes(-1.0f)); }

Vec3 normalize3(Vec3 v) { return scale3(v, 1.0f / sqrt(dot3(v, v))); }
