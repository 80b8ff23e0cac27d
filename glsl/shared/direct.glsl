// Direct light by shadow rays: point lights to a visible surface.

// Radiance towards the viewer, W·m⁻²·sr⁻¹.
Vec3 direct_light(SCENE_PARAMS Surface surface, Vec3 to_viewer) {
    Vec3 sum = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
#ifdef HAS_LIGHTS
    Vec3 diffuse = scale3(object_color(surface.object), object_diffuse(surface.object) * INV_PI);
#ifdef HAS_GLOSSY
    Real specular = object_specular(surface.object);
    // Surfaces without a lobe have α = 0: any other value keeps the unused lobe finite.
    Real alpha = pick(specular > 0.0f, object_roughness(surface.object), 1.0f);
    Real cos_o = dot3(surface.normal, to_viewer);
#endif
    for (int i = 0; i < LIGHT_COUNT; i++) {
        Vec3 towards = sub3(light_position_same(i), surface.position);
        Real distance2 = dot3(towards, towards);
        Real distance = sqrt(distance2);
        Vec3 to_light = scale3(towards, 1.0f / distance);
        Real cos_i = dot3(surface.normal, to_light);
        Bool lit = cos_i > 0.0f && surface.object >= 0;
#ifdef HAS_SHADOWS
        if (any_lane(lit))
            lit = lit && !occluded(SCENE surface.position, light_position_same(i), to_light, distance, surface.object);
#endif
        Vec3 bsdf = diffuse;
#ifdef HAS_GLOSSY
        Real lobe = specular * ggx(surface.normal, to_viewer, to_light, max(cos_o, lanes(0.0f)), cos_i, alpha);
        bsdf = add3(bsdf, make3(lobe, lobe, lobe));
#endif
        Vec3 reflected = mul3(bsdf, scale3(light_intensity_same(i), cos_i / distance2));
        sum = add3(sum, pick3(lit, reflected, make3(lanes(0.0f), lanes(0.0f), lanes(0.0f))));
    }
#endif
    return sum;
}
