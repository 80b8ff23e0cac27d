// One pixel's radiance: the mean over its samples of what the camera sees.

// `tile` is the pixel's, where photons are gathered by tiles.
Vec3 radiance_along(SCENE_PARAMS Sample at, Int tile) {
    Vec3 origin = frame_position();
    Vec3 direction = camera_direction(SCENE at.x, at.y);
    Vec3 radiance = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
#ifdef HAS_SHAPES
    Hit hit = closest_hit(SCENE origin, direction, lanes_i(NO_FACE));
    Bool visible = hit.shape >= 0;
#ifdef GATHER_GROUP
    // A group's work-items come to its barriers together.
    {
#else
    if (any_lane(visible)) {
#endif
        // A lane that saw nothing shades object 0 and is dropped below.
        hit.shape = pick_i(visible, hit.shape, 0);
        hit.t = pick(visible, hit.t, 0.0f);
        Surface surface = surface_at(SCENE origin, direction, hit);
#ifdef SLICED
        // What photons do not carry belongs to one of the draws.
        if (SLICE == 0)
#endif
        radiance = direct_light(SCENE surface, negate3(direction));
#ifdef HAS_PHOTONS
        radiance = add3(radiance, photon_radiance(SCENE surface, negate3(direction), visible, tile));
#endif
#ifdef HAS_FINAL_GATHER
        Vec3 diffuse = scale3(material_color(MATERIAL_OF(hit.shape)), material_diffuse(MATERIAL_OF(hit.shape)) * INV_PI);
        radiance = add3(radiance, mul3(diffuse, indirect_irradiance(SCENE surface, visible, at.x, at.y, at.key)));
#endif
#ifdef HAS_AMBIENT
#ifdef SLICED
        if (SLICE == 0)
#endif
        radiance = add3(radiance, scale3(material_color(MATERIAL_OF(hit.shape)), material_ambient(MATERIAL_OF(hit.shape))));
#endif
        radiance = pick3(visible, radiance, make3(lanes(0.0f), lanes(0.0f), lanes(0.0f)));
    }
#endif
    return radiance;
}

Vec3 pixel_radiance(SCENE_PARAMS Int column, Int row) {
#ifdef GATHER_TILES
    Int tile = tile_at(SCENE column, row);
#else
    Int tile = lanes_i(0);
#endif
#ifdef ONE_SAMPLE
    return radiance_along(SCENE sample_point(SCENE column, row, 0), tile);
#else
    Vec3 sum = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
    int samples = count_of(frame_samples());
    int s = 0;
    do { // as in gather.glsl, so that no sample is for nothing
        sum = add3(sum, radiance_along(SCENE sample_point(SCENE column, row, s), tile));
        s++;
    } while (s < samples);
    return scale3(sum, lanes(1.0f / float_of(samples)));
#endif
}
