// What `photile stress` asks of the tracer's own functions, on every machine: included after them.
// CASES are texels of the suite's own; an answer is eight words.

STRUCT(Answer)
struct Answer {
    Uint a;
    Uint b;
    Uint c;
    Uint d;
    Uint e;
    Uint f;
    Uint g;
    Uint h;
};

#if defined(STRESS_INTERSECTION)
// Case i: object i and ray i (origin, direction; 1 where the ray starts on the object). Distance, then the surface.
INLINE Answer stress(SCENE_PARAMS CASE_PARAMS Int i) {
    Vec3 origin = FETCH3(cases, i, 3, 0);
    Vec3 direction = FETCH3(cases, i, 3, 1);
    Bool on = FETCH1(cases, i, 3, 2, 0) > 0.5f;
    Vec3 anchor = object_anchor(i);
    Real extent = object_extent(i);
    Bool is_sphere = i < SPHERE_COUNT;
    Real to_sphere = hit_sphere(origin, direction, anchor, extent, on);
    Real to_plane = hit_plane(origin, direction, anchor, extent, on);
    Hit hit;
    hit.t = pick(is_sphere, to_sphere, to_plane);
    hit.next = lanes(INFINITE);
    hit.object = i;
    Surface surface = surface_at(SCENE origin, direction, hit);
    Answer answer;
    answer.a = bits_of(hit.t);
    answer.b = bits_of(surface.position.x);
    answer.c = bits_of(surface.position.y);
    answer.d = bits_of(surface.position.z);
    answer.e = bits_of(surface.normal.x);
    answer.f = bits_of(surface.normal.y);
    answer.g = bits_of(surface.normal.z);
    answer.h = bits_of(surface.side);
    return answer;
}

#elif defined(STRESS_LEAKS)
// Walks from a point in a closed box: cases hold the box's lowest and highest corner, (tolerance, rays, seed), the
// point. Counted are rays, those that hit nothing, those that hit the surface they leave, points outside the box,
// points inside a sphere.
INLINE Answer stress(SCENE_PARAMS CASE_PARAMS Int i) {
    Vec3 low = FETCH3_SAME(cases, 0, 1, 0);
    Vec3 high = FETCH3_SAME(cases, 1, 1, 0);
    Real tolerance = FETCH1_SAME(cases, 2, 1, 0, 0);
    int rays = count_of(FETCH1_SCALAR(cases, 2, 1, 0, 1));
    Vec3 start = FETCH3_SAME(cases, 3, 1, 0);
    Uint key = hash2_u(to_uint(i), lanes_u(uint_of(FETCH1_SCALAR(cases, 2, 1, 0, 2))));
    Uint none = lanes_u(0u);
    Uint one = lanes_u(1u);
    Answer answer;
    answer.a = none;
    answer.b = none;
    answer.c = none;
    answer.d = none;
    answer.e = none;
    answer.f = none;
    answer.g = none;
    answer.h = none;
    Vec3 position = start;
    Vec3 direction = sample_sphere(hash_u(key + 1u), hash_u(key + 2u));
    Int object = lanes_i(NO_OBJECT);
    Bool outside_of_it = lanes_i(0) != 0;
    for (int ray = 0; ray < rays; ray++) {
        key = hash_u(key);
        Hit hit = closest_hit(SCENE position, direction, object);
        Bool escaped = hit.object < 0;
        Bool own = !escaped && hit.object == object && (outside_of_it || object >= SPHERE_COUNT);
        hit.object = pick_i(escaped, 0, hit.object);
        hit.t = pick(escaped, 0.0f, hit.t);
        Surface surface = surface_at(SCENE position, direction, hit);
        Vec3 p = surface.position;
        Bool outside = p.x < low.x - tolerance || p.y < low.y - tolerance || p.z < low.z - tolerance ||
            p.x > high.x + tolerance || p.y > high.y + tolerance || p.z > high.z + tolerance;
        Bool inside = hit.object < SPHERE_COUNT && surface.side < 0.0f;
        outside = outside && !escaped;
        inside = inside && !escaped;
        answer.a += one;
        answer.b += pick_u(escaped, one, none);
        answer.c += pick_u(own, one, none);
        answer.d += pick_u(outside, one, none);
        answer.e += pick_u(inside, one, none);
        Bool lost = escaped || own || outside || inside;
        Vec3 onward = sample_cosine(surface.normal, hash_u(key + 1u), hash_u(key + 2u));
        Vec3 anew = sample_sphere(hash_u(key + 1u), hash_u(key + 2u));
        direction = pick3(lost, anew, onward);
        position = pick3(lost, start, p);
        object = pick_i(lost, NO_OBJECT, hit.object);
        outside_of_it = !lost && surface.side > 0.0f;
    }
    return answer;
}

#elif defined(STRESS_RANDOM)
// Case i: two counters. What the renderer makes of them.
INLINE Answer stress(SCENE_PARAMS CASE_PARAMS Int i) {
    // A float holds 16 bits of a counter exactly.
    Vec3 halves = FETCH3(cases, i, 2, 0);
    Vec3 others = FETCH3(cases, i, 2, 1);
    Uint first = to_uint(to_int(halves.x)) | (to_uint(to_int(halves.y)) << 16u);
    Uint second = to_uint(to_int(others.x)) | (to_uint(to_int(others.y)) << 16u);
    Vec3 turned = sample_sphere(first, second);
    Answer answer;
    answer.a = hash2_u(first, second);
    answer.b = bits_of(unit_real(first));
    answer.c = owen_scramble(sobol_second(first), second);
    answer.d = sequence_u(first, R4_STEP_0, second);
    answer.e = bits_of(turned.x);
    answer.f = bits_of(turned.y);
    answer.g = bits_of(turned.z);
    answer.h = reverse_bits(first);
    return answer;
}
#endif
