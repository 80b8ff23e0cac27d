// A photon's walk: emission by a light, scattering by a surface. Counters in, so that any path can be walked again
// alone: numbers depend on (seed, pass, path, bounce, dimension) only.

STRUCT(Photon)
struct Photon {
    Vec3 position;  // scene space, where it comes from
    Vec3 direction; // unit
    Vec3 throughput; // relative to `power`
    Real power;     // W
    Int face;       // that it leaves, NO_FACE for a light
    Int bounce;     // 0 until the first hit
    Uint key;       // of this bounce's numbers
    Uint height;    // the first bounce's numbers, from the sequence
    Uint turn;
};

// Numbers of one bounce: dimension d of key.
INLINE Uint number_u(Uint key, uint dimension) { return hash_u(key + dimension * 0x9e3779b9u); }

// `path` counts from 0 over all lights; `stream` is the hash of seed and pass.
INLINE Photon emit_photon(SCENE_PARAMS EMISSION_PARAMS Uint path, Uint stream) {
    Photon photon;
    photon.face = lanes_i(NO_FACE);
    photon.bounce = lanes_i(0);
    photon.key = hash_u(path ^ stream);
#ifdef ONE_EMITTER
    Uint index = path;
    Uint shift = stream;
    photon.position = emitter_position_same(0);
    photon.throughput = emitter_color_same(0);
    photon.power = emitter_power_same(0);
#else
    // A round of SLOTS paths serves each light in proportion to its flux; each light counts its own paths from 0.
    Uint slot = FETCH_U(slots, path & (SLOTS - 1u));
    Int light = to_int_of(slot >> SLOTS_LOG2);
    Uint index = (path >> SLOTS_LOG2) * FETCH_U(emitter_counts, (slot >> SLOTS_LOG2) * 3u) + (slot & (SLOTS - 1u));
    Uint shift = hash_u(stream ^ to_uint(light));
    photon.position = emitter_position(light);
    photon.throughput = emitter_color(light);
    photon.power = emitter_power(light);
#endif
#ifdef SAMPLER_RANDOM
    Uint height = number_u(photon.key, 4u);
    Uint turn = number_u(photon.key, 5u);
    photon.height = number_u(photon.key, 6u);
    photon.turn = number_u(photon.key, 7u);
#else
    Uint height = sequence_u(index, R4_STEP_0, number_u(shift, 4u));
    Uint turn = sequence_u(index, R4_STEP_1, number_u(shift, 5u));
    photon.height = sequence_u(index, R4_STEP_2, number_u(shift, 6u));
    photon.turn = sequence_u(index, R4_STEP_3, number_u(shift, 7u));
#endif
#ifdef HAS_EMISSION_MAP
    // Only cells of the sphere in which something can be hit, each in parts of equal height, more of them where its
    // light is worth more: the first number chooses a part, and what is left of it the height within.
#ifdef ONE_EMITTER
    uint first = emitter_counts[1];
    uint cells = emitter_counts[2];
#else
    Uint first = FETCH_U(emitter_counts, (slot >> SLOTS_LOG2) * 3u + 1u);
    Uint cells = FETCH_U(emitter_counts, (slot >> SLOTS_LOG2) * 3u + 2u);
#endif
    Uint entry = FETCH_U(emission_cells, multiply_high(height, lanes_u(cells)) + first);
    Uint cell = entry & (EMISSION_ROWS * EMISSION_COLUMNS - 1u);
    Real parts = u_to_real((entry >> EMISSION_CELL_BITS) & ((1u << EMISSION_PART_BITS) - 1u));
    Real part = u_to_real(entry >> (EMISSION_CELL_BITS + EMISSION_PART_BITS));
    Real row = u_to_real(cell >> EMISSION_COLUMNS_LOG2);
    Uint column = cell & (EMISSION_COLUMNS - 1u);
    Real z = 1.0f - (row + (part + unit_real(height * cells)) / parts) * (2.0f / float_of(EMISSION_ROWS));
    photon.power = photon.power / parts;
    photon.direction = sphere_at(z, (column << (32u - EMISSION_COLUMNS_LOG2)) + (turn >> EMISSION_COLUMNS_LOG2));
#else
    photon.direction = sample_sphere(height, turn);
#endif
    return photon;
}

INLINE Real largest(Vec3 v) { return max(max(v.x, v.y), v.z); }

STRUCT(Material)
struct Material {
    Vec3 diffuse; // kd·c
    Real specular;
    Real alpha;
};

// What happens at a surface: absorbed, or a new direction. `photon` arrives; its key moves on to the next bounce.
// Russian roulette keeps the largest channel of the throughput where it is: survivors of a grey wall all carry the same.
STRUCT(Scattered)
struct Scattered {
    Photon photon;
    Bool survives;
};

INLINE Scattered scatter(Photon photon, Surface surface, Material material) {
    Scattered scattered;
    Real before = largest(photon.throughput);
    Vec3 diffuse = mul3(photon.throughput, material.diffuse);
    Real after = largest(diffuse);
    // Shares of `before`, so that nothing is divided: [0, after) goes on diffusely, [after, after + mirrored) by the
    // lobe, the rest is absorbed.
    Real chance = unit_real(number_u(photon.key, 0u)) * before;
    Real limit = lanes(1.0f);
    Real kept = after;
#ifdef HAS_GLOSSY
    kept = kept + material.specular * before;
#endif
    // White walls would keep a photon for ever: from this bounce on at least a twentieth stops.
    Bool late = photon.bounce >= 16 && kept > 0.95f * before;
    if (any_lane(late)) limit = pick(late, 0.95f * before / kept, 1.0f);
    scattered.survives = chance < kept * limit;

    Bool first = photon.bounce == 0;
    Uint height = pick_u(first, photon.height, number_u(photon.key, 1u));
    Uint turn = pick_u(first, photon.turn, number_u(photon.key, 2u));
    scattered.photon.direction = sample_cosine(surface.normal, height, turn);
    scattered.photon.throughput = scale3(diffuse, before / (after * limit));
#ifdef HAS_GLOSSY
    Bool reflected = chance >= after * limit;
    if (any_lane(reflected && scattered.survives)) {
        Vec3 to_viewer = negate3(photon.direction);
        Vec3 half_way = sample_ggx(surface.normal, to_viewer, material.alpha, height, turn);
        Vec3 mirrored = sub3(scale3(half_way, 2.0f * dot3(half_way, to_viewer)), to_viewer);
        Real cosine = dot3(mirrored, surface.normal);
        Vec3 specular = scale3(photon.throughput, smith_g1(cosine, material.alpha) / limit);
        scattered.photon.direction = pick3(reflected, normalize3(mirrored), scattered.photon.direction);
        scattered.photon.throughput = pick3(reflected, specular, scattered.photon.throughput);
        // Facets send some light into the surface: lost, as in the BSDF.
        scattered.survives = scattered.survives && (!reflected || cosine > 0.0f);
    }
#endif
    scattered.photon.power = photon.power;
    scattered.photon.position = surface.position;
    scattered.photon.face = face_left(surface);
    scattered.photon.bounce = photon.bounce + 1;
    scattered.photon.key = hash_u(photon.key);
    scattered.photon.height = photon.height;
    scattered.photon.turn = photon.turn;
    return scattered;
}

INLINE Photon no_photon() {
    Photon p;
    p.position = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
    p.direction = p.position;
    p.throughput = p.position;
    p.power = lanes(0.0f);
    p.face = lanes_i(NO_FACE);
    p.bounce = lanes_i(0);
    p.key = lanes_u(0u);
    p.height = p.key;
    p.turn = p.key;
    return p;
}

INLINE Photon pick_photon(Bool c, Photon a, Photon b) {
    Photon p;
    p.position = pick3(c, a.position, b.position);
    p.direction = pick3(c, a.direction, b.direction);
    p.throughput = pick3(c, a.throughput, b.throughput);
    p.power = pick(c, a.power, b.power);
    p.face = pick_i(c, a.face, b.face);
    p.bounce = pick_i(c, a.bounce, b.bounce);
    p.key = pick_u(c, a.key, b.key);
    p.height = pick_u(c, a.height, b.height);
    p.turn = pick_u(c, a.turn, b.turn);
    return p;
}

// One ray of a walk: from a photon under way to the surface that it meets, and onward.
STRUCT(Step)
struct Step {
    Surface surface;
    Bool stored;   // a photon belongs here
    Bool survives; // `photon` goes on
    Photon photon;
};

INLINE Step walk(SCENE_PARAMS Photon photon) {
    Step step;
    Hit hit = closest_hit(SCENE photon.position, photon.direction, photon.face);
    Bool visible = hit.shape >= 0;
    hit.shape = pick_i(visible, hit.shape, 0);
    hit.t = pick(visible, hit.t, 0.0f);
    step.surface = surface_at(SCENE photon.position, photon.direction, hit);
    Material material;
    Real diffuse = material_diffuse(MATERIAL_OF(hit.shape));
    material.diffuse = scale3(material_color(MATERIAL_OF(hit.shape)), diffuse);
    step.stored = visible && diffuse > 0.0f;
#ifdef HAS_GLOSSY
    material.specular = material_specular(MATERIAL_OF(hit.shape));
    material.alpha = material_roughness(MATERIAL_OF(hit.shape));
    // A perfect mirror keeps nothing: no density estimate could see it.
    step.stored = step.stored || (visible && material.specular > 0.0f && material.alpha > 0.0f);
#endif
#ifndef STORE_DIRECT
    step.stored = step.stored && photon.bounce > 0;
#endif
    Scattered scattered = scatter(photon, step.surface, material);
    step.photon = scattered.photon;
    step.survives = visible && scattered.survives;
    return step;
}
