// Arithmetic as other devices have it, for `photile stress`: dot products of fused operations, and roots and quotients
// that are off by up to three ulps, as OpenCL 1.2 allows (a table in its section 7.4; GPUs make use of it). Which way
// is decided by the operand's own bits, so the same ray is the same again.
Real nudge(Real x) {
    Uint ulps = hash_u(bits_of(x)) % 7u;
    Bool kept = x == 0.0f || !(fabs(x) < 3.0e38f);
    return pick(kept, x, from_bits(bits_of(x) + ulps - 3u));
}

Real nudged_sqrt(Real x) { return nudge(sqrt(x)); }
Real fused_dot(Vec3 a, Vec3 b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
#define sqrt(x) nudged_sqrt(x)
#undef dot3
#define dot3(a, b) fused_dot(a, b)
