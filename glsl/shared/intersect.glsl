// Ray against sphere and plane. Distances are in units of the (unit) direction; INFINITE means no hit.
//
// No epsilon anywhere: a ray that starts on a surface names it (`origin_on`), and that surface's other root is
// taken exactly, so neither scale nor distance from the world's origin can make a surface hit itself.
//
// Mostly the camera and all lights are outside of every sphere and on the front of every plane; whatever light meets
// is then met from there. Which side a ray is on is known, not computed: a point that rounding has put a hair behind
// a surface, beside an edge or a contact, meets that surface at once. So no ray leaves a closed room, whatever the
// device's arithmetic. Only scenes with HAS_TWO_SIDED have to ask.

#define LEAST_DISTANCE 1e-18f // of a hit: a root that rounding has brought to nothing or behind is still in front

// Nearest root in front of the origin. The discriminant comes from the ray's closest approach rather than from
// b² − c, which cancels for small or far spheres (Haines et al., Ray Tracing Gems, ch. 7). The way to that approach is
// taken twice, the second time from where the first one ended: its own rounding goes, and that of the direction, whose
// length is 1 to an ulp only. Roots are then within 4 ulps of the largest length, up to 60° from the normal; taking the
// smaller one as c / larger, as is usual, costs a division and gives 5.
//
// `origin_on`: the ray starts on this object, and with `behind` it leaves on the side that normals do not point to.
Real hit_sphere(Vec3 origin, Vec3 direction, Vec3 center, Real radius, Bool origin_on, Bool behind) {
    Vec3 from_center = sub3(origin, center);
    Real approach = 0.0f - dot3(from_center, direction);
    Vec3 closest = add3(from_center, scale3(direction, approach));
    approach = approach - dot3(closest, direction);
    Real discriminant = radius * radius - dot3(closest, closest);
    Real root = sqrt(max(discriminant, lanes(0.0f)));
#ifdef HAS_TWO_SIDED
    // Which root it is must not depend on the root's own rounding: a ray that starts a hair off the sphere, beside a
    // contact, would pass into it.
    Bool outside = dot3(from_center, from_center) > radius * radius;
    Real t = max(pick(outside, approach - root, approach + root), lanes(LEAST_DISTANCE));
    Bool hit = discriminant >= 0.0f && (approach > 0.0f || !outside);
    // Starting on the sphere one root is 0: the other is twice the way to the closest approach, and met from within.
    t = pick(origin_on, max(2.0f * approach, lanes(LEAST_DISTANCE)), t);
    hit = pick_b(origin_on, behind, hit);
#else
    Real t = max(approach - root, lanes(LEAST_DISTANCE));
    Bool hit = discriminant >= 0.0f && approach > 0.0f && !origin_on;
#endif
    return pick(hit, t, INFINITE);
}

Real hit_plane(Vec3 origin, Vec3 direction, Vec3 normal, Real offset, Bool origin_on) {
    Real slope = dot3(normal, direction);
    Real t = (offset - dot3(normal, origin)) / slope;
#ifdef HAS_TWO_SIDED
    // A parallel ray gives ±infinity or NaN, both refused here.
    Bool hit = t > 0.0f && t < INFINITE && !origin_on;
#else
    // Normals point to where the lights are (pack.rs).
    Bool hit = slope < 0.0f && !origin_on;
    t = max(t, lanes(LEAST_DISTANCE));
#endif
    return pick(hit, t, INFINITE);
}
