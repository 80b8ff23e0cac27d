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
INLINE Answer stress(SCENE_PARAMS CASES_PARAMS Int i) {
    Vec3 origin = FETCH3(cases, i, 3, 0);
    Vec3 direction = FETCH3(cases, i, 3, 1);
    Bool on = FETCH1(cases, i, 3, 2, 0) > 0.5f;
    Vec3 anchor = shape_anchor(i);
    Real extent = shape_extent(i);
    Bool is_sphere = IS_SPHERE(i);
    Real to_sphere = hit_sphere(origin, direction, anchor, extent, on, on);
    Real to_plane = hit_plane(origin, direction, anchor, extent, on);
    Hit hit;
    hit.t = pick(is_sphere, to_sphere, to_plane);
    hit.shape = i;
    hit.from = pick_i(on, FACE_OF(i, 1), NO_FACE);
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
// 2 to the power of −(bits mod 27): from a whole room down to less than an ulp of it.
INLINE Real fraction_u(Uint bits) { return from_bits((127u - bits % 27u) << 23u); }

// A direction to where rounding matters: near a contact of two objects, or an edge of the box. Case 5 + 2j is such a
// place, the next one the way along it; case 4 is (number of them, size of the room). Every fourth ray also hugs the
// surface that it leaves. What would go into that surface is left as it is.
INLINE Vec3 aimed(CASES_PARAMS Surface surface, Uint key, Vec3 otherwise) {
    Uint places = lanes_u(uint_of(FETCH1_SCALAR(cases, 4, 1, 0, 0)));
    Real size = FETCH1_SAME(cases, 4, 1, 0, 1);
    Int place = to_int(hash_u(key + 3u) % places);
    Vec3 along = FETCH3(cases, place * 2 + 6, 1, 0);
    Vec3 target = add3(FETCH3(cases, place * 2 + 5, 1, 0), scale3(along, unit_real(hash_u(key + 4u))));
    Vec3 beside = scale3(sample_sphere(hash_u(key + 5u), hash_u(key + 6u)), size * fraction_u(hash_u(key + 7u)));
    Vec3 way = sub3(add3(target, beside), surface.position);
    Vec3 direction = scale3(way, 1.0f / sqrt(max(dot3(way, way), lanes(1.0e-30f))));
    Uint bits = hash_u(key + 8u);
    Real lift = fraction_u(bits >> 2u) - dot3(direction, surface.normal);
    Vec3 hugging = normalize3(add3(direction, scale3(surface.normal, lift)));
    direction = pick3((bits & 3u) == 0u, hugging, direction);
    return pick3(dot3(direction, surface.normal) > 0.0f, direction, otherwise);
}

// Walks from a point in a closed box: cases hold the box's lowest and highest corner, (tolerance, rays, seed), the
// point, then the places. Odd items aim half of their rays. Counted are rays, those that hit nothing, those that hit
// the surface they leave, points outside the box, points inside a sphere; then comes the first ray so lost, from 1.
// STRESS_REPLAY instead tells the last ray's origin and direction, what it left and what it hit.
INLINE Answer stress(SCENE_PARAMS CASES_PARAMS Int i) {
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
    Int face = lanes_i(NO_FACE);
    for (int ray = 0; ray < rays; ray++) {
        key = hash_u(key);
        Hit hit = closest_hit(SCENE position, direction, face);
#ifdef STRESS_REPLAY
        answer.a = bits_of(position.x);
        answer.b = bits_of(position.y);
        answer.c = bits_of(position.z);
        answer.d = bits_of(direction.x);
        answer.e = bits_of(direction.y);
        answer.f = bits_of(direction.z);
        answer.g = to_uint(face);
        answer.h = to_uint(hit.shape);
#endif
        Bool escaped = hit.shape < 0;
        Bool own = !escaped && hit.shape == SHAPE_OF(face) && (!IS_BEHIND(face) || !IS_SPHERE(hit.shape));
        hit.shape = pick_i(escaped, 0, hit.shape);
        hit.t = pick(escaped, 0.0f, hit.t);
        Surface surface = surface_at(SCENE position, direction, hit);
        Vec3 p = surface.position;
        Bool outside = p.x < low.x - tolerance || p.y < low.y - tolerance || p.z < low.z - tolerance ||
            p.x > high.x + tolerance || p.y > high.y + tolerance || p.z > high.z + tolerance;
        Bool inside = IS_SPHERE(hit.shape) && surface.side < 0.0f;
        for (int k = FIRST_SPHERE; k < END_SPHERE; k++) {
            Vec3 away = sub3(p, shape_anchor_same(k));
            Real depth = max(shape_extent_same(k) - tolerance, lanes(0.0f));
            inside = inside || dot3(away, away) < depth * depth;
        }
        outside = outside && !escaped;
        inside = inside && !escaped;
        Bool lost = escaped || own || outside || inside;
#ifndef STRESS_REPLAY
        answer.a += one;
        answer.b += pick_u(escaped, one, none);
        answer.c += pick_u(own, one, none);
        answer.d += pick_u(outside, one, none);
        answer.e += pick_u(inside, one, none);
        answer.f = pick_u(lost && answer.f == 0u, lanes_u(uint_of(ray)) + 1u, answer.f);
#endif
        Vec3 onward = sample_cosine(surface.normal, hash_u(key + 1u), hash_u(key + 2u));
        Bool aims = (i & 1) != 0 && (hash_u(key + 9u) & 1u) != 0u;
        if (any_lane(aims)) onward = pick3(aims, aimed(CASES surface, key, onward), onward);
        Vec3 anew = sample_sphere(hash_u(key + 1u), hash_u(key + 2u));
        direction = pick3(lost, anew, onward);
        position = pick3(lost, start, p);
        face = pick_i(lost, NO_FACE, face_left(surface));
    }
    return answer;
}

#elif defined(STRESS_RANDOM)
// Case i: two counters. What the renderer makes of them.
INLINE Answer stress(SCENE_PARAMS CASES_PARAMS Int i) {
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
