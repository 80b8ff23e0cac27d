// One pixel's radiance: the mean over its samples of what the camera sees.

Vec3 radiance_along(SCENE_PARAMS Vec3 origin, Vec3 direction) {
    Vec3 radiance = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
#ifdef HAS_OBJECTS
    Hit hit = closest_hit(SCENE origin, direction, lanes_i(NO_OBJECT));
    Bool visible = hit.object >= 0;
    if (any_lane(visible)) {
        // A lane that saw nothing shades object 0 and is dropped below.
        hit.object = pick_i(visible, hit.object, 0);
        hit.t = pick(visible, hit.t, 0.0f);
        Surface surface = surface_at(SCENE origin, direction, hit);
#ifdef SLICED
        // What photons do not carry belongs to one of the draws.
        if (SLICE == 0)
#endif
        radiance = direct_light(SCENE surface, negate3(direction));
#ifdef HAS_PHOTONS
        radiance = add3(radiance, photon_radiance(SCENE surface, negate3(direction), visible));
#endif
#ifdef HAS_AMBIENT
#ifdef SLICED
        if (SLICE == 0)
#endif
        radiance = add3(radiance, scale3(object_color(hit.object), object_ambient(hit.object)));
#endif
        radiance = pick3(visible, radiance, make3(lanes(0.0f), lanes(0.0f), lanes(0.0f)));
    }
#endif
    return radiance;
}

Vec3 pixel_radiance(SCENE_PARAMS Int column, Int row) {
    Vec3 sum = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
#ifdef ONE_SAMPLE
    Vec3 direction = camera_direction(SCENE to_real(column) + 0.5f, to_real(row) + 0.5f);
    return radiance_along(SCENE frame_position(), direction);
#else
    Uint pixel_key = hash2_u(to_uint(column), to_uint(row) ^ FRAME_SEED);
    int samples = count_of(frame_samples());
    for (int s = 0; s < samples; s++) {
        Uint index = to_uint(lanes_i(count_of(frame_first_sample()) + s));
        Real x = to_real(column) + jitter_x(index, pixel_key);
        Real y = to_real(row) + jitter_y(index, pixel_key);
        sum = add3(sum, radiance_along(SCENE frame_position(), camera_direction(SCENE x, y)));
    }
    return scale3(sum, lanes(1.0f / float_of(samples)));
#endif
}
