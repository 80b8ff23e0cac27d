// Pinhole camera: from a pixel and a sample's number to a primary ray.

// Where in its pixel a sample lies, in [0, 1)²: Owen-scrambled Sobol' (0,2) points, scrambled per pixel and
// axis, so that any number of samples is stratified. A single sample is the pixel's centre.
Real jitter_x(Uint index, Uint pixel_key) {
    return unit_real(reverse_bits(scramble_reversed(index, hash_u(pixel_key))));
}

Real jitter_y(Uint index, Uint pixel_key) {
    return unit_real(owen_scramble(sobol_second(index), hash_u(pixel_key ^ 0x68bc21ebu)));
}

// A 32-bit seed travels as two halves: floats hold integers exactly below 2²⁴ only.
#define FRAME_SEED (uint_of(frame_seed_low()) | (uint_of(frame_seed_high()) << 16u))

// Unit direction through the point (x, y) of the image plane, in pixels from the image's top left corner.
Vec3 camera_direction(SCENE_PARAMS Real x, Real y) {
    Real across = x * (2.0f / frame_width()) - 1.0f;
    Real upward = 1.0f - y * (2.0f / frame_height());
    Vec3 d = add3(frame_forward(), add3(scale3(frame_right(), across), scale3(frame_up(), upward)));
    return normalize3(d);
}

// Where on the image plane one of a pixel's samples lies, counted from the picture's first; and the pixel's key.
STRUCT(Sample)
struct Sample {
    Real x;
    Real y;
    Uint key;
};

Sample sample_point(SCENE_PARAMS Int column, Int row, int number) {
    Sample at;
    at.key = hash2_u(to_uint(column), to_uint(row) ^ FRAME_SEED);
#ifdef ONE_SAMPLE
    at.x = to_real(column) + 0.5f;
    at.y = to_real(row) + 0.5f;
#else
    Uint index = to_uint(lanes_i(count_of(frame_first_sample()) + number));
    at.x = to_real(column) + jitter_x(index, at.key);
    at.y = to_real(row) + jitter_y(index, at.key);
#endif
    return at;
}

// Unit direction of one of a pixel's samples.
Vec3 sample_direction(SCENE_PARAMS Int column, Int row, int number) {
    Sample at = sample_point(SCENE column, row, number);
    return camera_direction(SCENE at.x, at.y);
}
