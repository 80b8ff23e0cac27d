// The scene as rays see it: spheres are objects 0 … S−1, planes S … S+P−1.

#define NO_OBJECT (-1)

#define SPHERE_COUNT count_of(frame_sphere_count())
#define PLANE_COUNT count_of(frame_plane_count())
#ifdef ONE_LIGHT
#define LIGHT_COUNT 1
#else
#define LIGHT_COUNT count_of(frame_light_count())
#endif

STRUCT(Hit)
struct Hit {
    Real t;     // distance, INFINITE when nothing is hit
    Real next;  // distance of what would be hit without this object, INFINITE likewise
    Int object; // NO_OBJECT when nothing is hit
};

// First object along the ray; `origin_object` is the one that the ray starts on (or NO_OBJECT).
Hit closest_hit(SCENE_PARAMS Vec3 origin, Vec3 direction, Int origin_object) {
    Hit hit;
    hit.t = lanes(INFINITE);
    hit.next = lanes(INFINITE);
    hit.object = lanes_i(NO_OBJECT);
#ifdef HAS_SPHERES
    for (int i = 0; i < SPHERE_COUNT; i++) {
        Real t = hit_sphere(origin, direction, object_anchor_same(i), object_extent_same(i), origin_object == i);
        Bool closer = t < hit.t;
        hit.next = min(hit.next, max(t, hit.t));
        hit.t = pick(closer, t, hit.t);
        hit.object = pick_i(closer, i, hit.object);
    }
#endif
#ifdef HAS_PLANES
    for (int i = SPHERE_COUNT; i < SPHERE_COUNT + PLANE_COUNT; i++) {
        Real t = hit_plane(origin, direction, object_anchor_same(i), object_extent_same(i), origin_object == i);
        Bool closer = t < hit.t;
        hit.next = min(hit.next, max(t, hit.t));
        hit.t = pick(closer, t, hit.t);
        hit.object = pick_i(closer, i, hit.object);
    }
#endif
    return hit;
}

#ifdef HAS_SHADOWS
// Whether anything lies between the origin and a light at `distance` along the ray, or a lit point on `target_object`
// (NO_OBJECT for a light). Both ends face each other, so neither end's own object, convex as all are, comes between.
// Planes are only asked where one separates the camera from a light: no other can come between a visible point and
// its light, or what that light sees.
Bool occluded(SCENE_PARAMS Vec3 origin, Vec3 light, Vec3 direction, Real distance, Int origin_object, int target_object) {
    // Half an ulp of the distance: a light that lies on a sphere is not shadowed by it.
    Real reach = distance * 0.9999999f;
    Bool blocked = NO_LANE;
#ifdef HAS_SPHERE_SHADOWS
    for (int i = 0; i < SPHERE_COUNT; i++) {
        if (i == target_object) continue;
        blocked = blocked ||
            hit_sphere(origin, direction, object_anchor_same(i), object_extent_same(i), origin_object == i) < reach;
    }
#endif
#ifdef HAS_PLANE_SHADOWS
    // By sides rather than distances, which lose all digits where a ray grazes a plane that the light lies on.
    Real size = sqrt(dot3(light, light));
    for (int i = SPHERE_COUNT; i < SPHERE_COUNT + PLANE_COUNT; i++) {
        Real offset = object_extent_same(i);
        Real here = dot3(object_anchor_same(i), origin) - offset;
        Real there = dot3(object_anchor_same(i), light) - offset;
        // A light within rounding of the plane (a few ulps of the numbers that cancel) lies on it.
        Bool behind = here * there < 0.0f && fabs(there) > 1e-6f * (size + fabs(offset));
        blocked = blocked || (behind && origin_object != i && target_object != i);
    }
#endif
    return blocked;
}
#endif

// A point on a surface with all that shading needs.
STRUCT(Surface)
struct Surface {
    Vec3 position; // scene space, back on the surface to an ulp, on the ray's side of every plane
    Vec3 normal;   // unit, towards the side the ray came from
    Int object;
    Real side;     // +1 on the side that the stored normal points to, else −1
};

#ifdef HAS_PLANES
// A hit an ulp beside an edge may come to lie beyond the other plane, and a ray that goes on from there would leave a
// closed room (measured: one of 2·10⁷). Such a point is put back to the side on which the ray travelled.
INLINE Vec3 keep_side(SCENE_PARAMS Vec3 origin, Vec3 direction, Hit hit, Vec3 position) {
    Real size = fabs(origin.x) + fabs(origin.y) + fabs(origin.z) + hit.t;
    // Rounding reaches a few 1e-7 of the size past a plane; even at a grazing 1e-3 that is this far along the ray.
    // The edge is one with what the ray would meet next, or with what it has just left.
    Bool close = min(hit.next - hit.t, hit.t) < 5e-4f * size;
    if (!any_lane(close)) return position;
    for (int i = SPHERE_COUNT; i < SPHERE_COUNT + PLANE_COUNT; i++) {
        Vec3 normal = object_anchor_same(i);
        Real offset = object_extent_same(i);
        Real here = dot3(normal, position) - offset;
        Real there = dot3(normal, origin) - offset;
        // Of what the ray starts on, the direction knows the side.
        there = pick(fabs(there) < 5e-7f * size, dot3(normal, direction), there);
        // On the plane is beyond it: the next ray would not meet it at a distance of 0.
        Bool beyond = close && hit.object != i && here * there <= 0.0f;
        // Back, and eight ulps farther: then its side is known on the next ray too.
        Real push = copysign(fabs(here) + 1e-6f * size, there);
        position = pick3(beyond, add3(position, scale3(normal, push)), position);
    }
    return position;
}
#endif

Surface surface_at(SCENE_PARAMS Vec3 origin, Vec3 direction, Hit hit) {
    Surface surface;
    surface.object = hit.object;
    Vec3 p = add3(origin, scale3(direction, hit.t));
    Vec3 anchor = object_anchor(hit.object);
    Real extent = object_extent(hit.object);
    // Rounding along a long ray leaves p off the surface: put it back, then nothing needs an offset.
#if defined(HAS_SPHERES) && defined(HAS_PLANES)
    Bool is_sphere = hit.object < SPHERE_COUNT;
    Vec3 outward = normalize3(sub3(p, anchor));
    Vec3 on_sphere = add3(anchor, scale3(outward, extent));
    Vec3 on_plane = add3(p, scale3(anchor, extent - dot3(anchor, p)));
    surface.position = pick3(is_sphere, on_sphere, on_plane);
    surface.normal = pick3(is_sphere, outward, anchor);
#elif defined(HAS_SPHERES)
    surface.normal = normalize3(sub3(p, anchor));
    surface.position = add3(anchor, scale3(surface.normal, extent));
#else
    surface.normal = anchor;
    surface.position = add3(p, scale3(anchor, extent - dot3(anchor, p)));
#endif
#ifdef HAS_PLANES
    surface.position = keep_side(SCENE origin, direction, hit, surface.position);
#endif
    Bool from_behind = dot3(surface.normal, direction) > 0.0f;
    surface.normal = pick3(from_behind, negate3(surface.normal), surface.normal);
    surface.side = pick(from_behind, -1.0f, 1.0f);
    return surface;
}
