// Direct light by shadow rays: point lights to a visible surface.

#ifdef HAS_LIGHTS
// What one light brings to a surface.
STRUCT(Incident)
struct Incident {
    Bool lit;
    Vec3 irradiance; // W/m², if it is lit
    Vec3 to_light;   // unit
    Real cosine;     // between that and the normal
};

INLINE Incident incident_light(SCENE_PARAMS Surface surface, int light) {
    Vec3 towards = sub3(light_position_same(light), surface.position);
    Real distance2 = dot3(towards, towards);
    Real distance = sqrt(distance2);
    Incident incident;
    incident.to_light = scale3(towards, 1.0f / distance);
    incident.cosine = dot3(surface.normal, incident.to_light);
    incident.lit = incident.cosine > 0.0f && surface.shape >= 0;
#ifdef HAS_SHADOWS
    if (any_lane(incident.lit))
        incident.lit = incident.lit && !occluded(SCENE surface.position, light_position_same(light), incident.to_light,
                                                distance, face_left(surface), NO_SHAPE);
#endif
    incident.irradiance = scale3(light_intensity_same(light), incident.cosine / distance2);
    return incident;
}
#endif

// Radiance towards the viewer, W·m⁻²·sr⁻¹.
Vec3 direct_light(SCENE_PARAMS Surface surface, Vec3 to_viewer) {
    Vec3 sum = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
#ifdef HAS_LIGHTS
    Vec3 diffuse = scale3(material_color(MATERIAL_OF(surface.shape)), material_diffuse(MATERIAL_OF(surface.shape)) * INV_PI);
#ifdef HAS_GLOSSY
    Real specular = material_specular(MATERIAL_OF(surface.shape));
    // Surfaces without a lobe have α = 0: any other value keeps the unused lobe finite.
    Real alpha = pick(specular > 0.0f, material_roughness(MATERIAL_OF(surface.shape)), 1.0f);
    Real cos_o = dot3(surface.normal, to_viewer);
#endif
    for (int i = 0; i < LIGHT_COUNT; i++) {
        Incident incident = incident_light(SCENE surface, i);
        Vec3 bsdf = diffuse;
#ifdef HAS_GLOSSY
        Real lobe = specular * ggx(surface.normal, to_viewer, incident.to_light, max(cos_o, lanes(0.0f)), incident.cosine, alpha);
        bsdf = add3(bsdf, make3(lobe, lobe, lobe));
#endif
        Vec3 reflected = mul3(bsdf, incident.irradiance);
        sum = add3(sum, pick3(incident.lit, reflected, make3(lanes(0.0f), lanes(0.0f), lanes(0.0f))));
    }
#endif
    return sum;
}
