// Final gathering: indirect light at a visible point by one bounce of rays, which see direct light by shadow rays and
// all further bounces in the irradiance texels (Jensen, "Global Illumination Using Photon Maps", 1996).
//
// Directly lit surfaces are reached in two ways: by the rays, and by *lit points*, where paths from the lights first
// arrive, which are as dense as the irradiance (Keller, "Instant Radiosity", SIGGRAPH 1997). A ray seldom finds the
// bright spot beside a lamp; a lit point nearby is too bright. Weighed by the balance heuristic (Veach & Guibas,
// "Optimally Combining Sampling Techniques for Monte Carlo Rendering", SIGGRAPH 1995), neither matters: in gi_ref the
// variance of a ray falls from 1.30 to 0.14 of the mean's square.
//
// Irradiance is smooth where pixels are not. It is gathered at *sites*, the points that a lattice of camera rays sees,
// and pixels take it from the sites around them on their own surface; a pixel with none gathers its own.

#ifdef HAS_FINAL_GATHER
// Roberts' R₂ sequence, as R₄ in random.glsl.
#define R2_STEP_0 3242174889u
#define R2_STEP_1 2447445414u

// Share of the rays in what a point that light falls on directly, at the squared distance, brings: `facing` is
// cosθ cosθ'/π of the two surfaces, `density` that of lit points, 1/m² for each ray.
INLINE Real share_of_rays(Real facing, Real density, Real distance2) {
    // Rounding can turn a grazing cosine's sign, and where both are nothing there is nothing to share.
    facing = max(facing, lanes(0.0f));
    return facing / max(facing + density * distance2, lanes(1.0e-30f));
}

// What the lit points bring, W/m². `fewer`: how many times fewer rays than a site's come to the same place.
INLINE Vec3 from_lit_points(SCENE_PARAMS Surface to, Bool wanted, float fewer) {
    Vec3 sum = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
    int points = count_of(lattice_points());
    int i = 0;
    if (points > 0) do { // as in gather.glsl, so that no round is for nothing
        Vec3 position = lit_point_position_same(i);
        int shape = count_of(lit_point_shape_scalar(i));
        Vec3 towards = sub3(position, to.position);
        Real distance2 = dot3(towards, towards);
        Real distance = sqrt(distance2);
        Vec3 direction = scale3(towards, 1.0f / distance);
        Real cosine = dot3(to.normal, direction);
        Real cosine_there = 0.0f - dot3(lit_point_normal_same(i), direction);
        Bool lit = wanted && cosine > 0.0f && cosine_there > 0.0f && (to.shape != shape || sees_itself(SCENE shape));
#ifdef HAS_SHADOWS
        if (any_lane(lit)) lit = lit && !occluded(SCENE to.position, position, direction, distance, face_left(to), shape);
#endif
        Real facing = cosine * cosine_there * INV_PI;
        Real density = lit_point_density_same(i) * fewer;
        Vec3 brought = scale3(lit_point_irradiance_same(i), share_of_rays(facing, density, distance2) * fewer);
        sum = add3(sum, pick3(lit, brought, make3(lanes(0.0f), lanes(0.0f), lanes(0.0f))));
        i++;
    } while (i < points);
    return sum;
}

// Indirect irradiance, W/m²: π times the mean radiance along cosine-distributed directions. `key` chooses the shift of
// a sequence that goes on from pass to pass.
INLINE Vec3 final_gather(SCENE_PARAMS Surface from, Bool wanted, Uint key, int rays) {
    Vec3 sum = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
    float fewer = lattice_rays() / float_of(rays);
    Uint height_shift = hash_u(key);
    Uint turn_shift = hash_u(height_shift);
    uint first = uint_of(lattice_turn()) * uint_of(float_of(rays));
    int ray = 0;
    do {
        Uint index = lanes_u(first + uint_of(ray));
        Uint height = sequence_u(index, R2_STEP_0, height_shift);
        Uint turn = sequence_u(index, R2_STEP_1, turn_shift);
        Vec3 direction = sample_cosine(from.normal, height, turn);
        Hit hit = closest_hit(SCENE from.position, direction, face_left(from));
        Bool visible = hit.shape >= 0 && wanted;
        if (any_lane(visible)) {
            hit.shape = pick_i(visible, hit.shape, 0);
            hit.t = pick(visible, hit.t, 0.0f);
            Surface seen = surface_at(SCENE from.position, direction, hit);
            Vec3 irradiance = texel_irradiance(texel_of(SCENE seen));
#ifdef HAS_LIGHTS
            Real facing = 0.0f - dot3(from.normal, direction) * dot3(seen.normal, direction) * INV_PI;
            for (int i = 0; i < LIGHT_COUNT; i++) {
                Incident incident = incident_light(SCENE seen, i);
                Vec3 direct = incident.irradiance;
                Real density = lattice_points_per_watt() * fewer * (direct.x + direct.y + direct.z);
                direct = scale3(direct, share_of_rays(facing, density, hit.t * hit.t));
                irradiance = add3(irradiance, pick3(incident.lit, direct, make3(lanes(0.0f), lanes(0.0f), lanes(0.0f))));
            }
#endif
            Vec3 radiance = mul3(scale3(material_color(MATERIAL_OF(seen.shape)), material_diffuse(MATERIAL_OF(seen.shape)) * INV_PI), irradiance);
            sum = add3(sum, pick3(visible, radiance, make3(lanes(0.0f), lanes(0.0f), lanes(0.0f))));
        }
        ray++;
    } while (ray < rays);
    return add3(scale3(sum, lanes(PI / float_of(rays))), from_lit_points(SCENE from, wanted, fewer));
}

// As sites and photons keep it: what lies on other faces does not count.
INLINE Real face_of(Surface surface) { return to_real(face_left(surface)); }

// Where a site of the lattice lies on the image plane, in pixels. One column and row lie beyond each border.
INLINE Real site_x(SCENE_PARAMS Int column) { return (to_real(column) - 1.0f) * lattice_spacing() + lattice_offset_x(); }
INLINE Real site_y(SCENE_PARAMS Int row) { return (to_real(row) - 1.0f) * lattice_spacing() + lattice_offset_y(); }

#define LATTICE_KEY (uint_of(lattice_key_low()) | (uint_of(lattice_key_high()) << 16u))

#ifdef HAS_SITES
#define LEAST_WEIGHT 0.02f // below, a pixel is alone

// Distance from a point to the nearest surface but its own: irradiance varies over no shorter lengths (Ward, Rubinstein
// & Clear, "A Ray Tracing Solution for Diffuse Interreflection", SIGGRAPH 1988). From geometry rather than from the
// rays, whose noise would choose among sites by what they gathered.
INLINE Real clearance(SCENE_PARAMS Surface surface) {
    Real least = lanes(INFINITE);
#each shape
#ifdef HAS_KINDS
    for (int i = FIRST_KIND; i < END_KIND; i++) {
        Real distance = kind_distance(SCENE i, surface.position);
        least = pick(surface.shape == i, least, min(least, distance));
    }
#endif
#end each
    return least;
}

// Sites count less the farther they are, and nothing from one clearance on.
STRUCT(Blend)
struct Blend {
    Vec3 irradiance;
    Real weight;
};

INLINE Blend blend_site(SCENE_PARAMS Blend sum, Int column, Int row, Real weight, Surface surface, Real inverse_clearance) {
    Int site = row * count_of(lattice_columns()) + column;
    Vec3 towards = camera_direction(SCENE site_x(SCENE column), site_y(SCENE row));
    Vec3 position = add3(frame_position(), scale3(towards, site_surface_distance(site)));
    Vec3 apart = sub3(position, surface.position);
    weight = weight * max(1.0f - sqrt(dot3(apart, apart)) * inverse_clearance, lanes(0.0f));
    Real likeness = lanes(1.0f);
#each shape
#ifdef HAS_KINDS
#ifdef KIND_COMES_FIRST
    likeness = kind_likeness(SCENE surface.shape, apart);
#else
    likeness = pick(IS_KIND(surface.shape), kind_likeness(SCENE surface.shape, apart), likeness);
#endif
#endif
#end each
    weight = weight * likeness;
    weight = pick(site_surface_face(site) == face_of(surface), weight, 0.0f);
    sum.irradiance = add3(sum.irradiance, scale3(site_irradiance(site), weight));
    sum.weight = sum.weight + weight;
    return sum;
}
#endif

// Indirect irradiance at a visible point, seen through (x, y) of the image plane.
INLINE Vec3 indirect_irradiance(SCENE_PARAMS Surface surface, Bool wanted, Real x, Real y, Uint key) {
#ifdef HAS_SITES
    Real u = (x - lattice_offset_x()) / lattice_spacing() + 1.0f;
    Real v = (y - lattice_offset_y()) / lattice_spacing() + 1.0f;
    Int column = min(max(to_int(u), lanes_i(0)), lanes_i(count_of(lattice_columns()) - 2));
    Int row = min(max(to_int(v), lanes_i(0)), lanes_i(count_of(lattice_rows()) - 2));
    u = u - to_real(column);
    v = v - to_real(row);
    Blend sum;
    sum.irradiance = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
    sum.weight = lanes(0.0f);
    Real inverse_clearance = 1.0f / max(clearance(SCENE surface) * lattice_reach(), lanes(1e-20f));
    sum = blend_site(SCENE sum, column, row, (1.0f - u) * (1.0f - v), surface, inverse_clearance);
    sum = blend_site(SCENE sum, column + 1, row, u * (1.0f - v), surface, inverse_clearance);
    sum = blend_site(SCENE sum, column, row + 1, (1.0f - u) * v, surface, inverse_clearance);
    sum = blend_site(SCENE sum, column + 1, row + 1, u * v, surface, inverse_clearance);
    Bool alone = wanted && sum.weight < LEAST_WEIGHT;
    Vec3 irradiance = scale3(sum.irradiance, 1.0f / max(sum.weight, lanes(LEAST_WEIGHT)));
    if (any_lane(alone)) irradiance = pick3(alone, final_gather(SCENE surface, alone, key, count_of(lattice_own_rays())), irradiance);
    return irradiance;
#else
    return final_gather(SCENE surface, wanted, key, count_of(lattice_own_rays()));
#endif
}
#endif
