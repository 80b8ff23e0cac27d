// One site of the lattice: what its ray sees, and the irradiance there.

STRUCT(GatheredSite)
struct GatheredSite {
    Vec3 irradiance;
    Vec3 surface; // face, distance (layout.rs, SiteSurface)
};

INLINE GatheredSite gather_site(SCENE_PARAMS Int number) {
    Int columns = lanes_i(count_of(lattice_columns()));
    Int row = number / columns;
    Int column = number - row * columns;
    Vec3 direction = camera_direction(SCENE site_x(SCENE column), site_y(SCENE row));
    Vec3 origin = frame_position();
    Hit hit = closest_hit(SCENE origin, direction, lanes_i(NO_FACE));
    Bool visible = hit.shape >= 0;
    hit.shape = pick_i(visible, hit.shape, 0);
    hit.t = pick(visible, hit.t, 0.0f);
    Surface surface = surface_at(SCENE origin, direction, hit);
    // What reflects nothing diffusely needs nothing.
    Bool wanted = visible && material_diffuse(MATERIAL_OF(hit.shape)) > 0.0f;
    GatheredSite site;
    site.irradiance = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
    Uint key = hash2_u(to_uint(number), lanes_u(LATTICE_KEY));
    if (any_lane(wanted)) site.irradiance = final_gather(SCENE surface, wanted, key, count_of(lattice_rays()));
    site.surface = make3(pick(visible, face_of(surface), -1.0f), hit.t, lanes(0.0f));
    return site;
}
