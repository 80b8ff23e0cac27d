// The scene as rays see it: spheres are objects 0 … S−1, planes S … S+P−1.

#define NO_OBJECT (-1)
#define NO_FACE (-1)

// Faces: object i has face 2i, where its normal points, and 2i + 1 behind. A ray that starts on a surface names the
// face that it leaves.
#define OBJECT_OF(face) ((face) >> 1)
#define IS_BEHIND(face) (((face) & 1) != 0)

// Known to the compiler where objects are few (features.rs): it unrolls what loops over them.
#ifndef SPHERE_COUNT
#define SPHERE_COUNT count_of(frame_sphere_count())
#define PLANE_COUNT count_of(frame_plane_count())
#endif
#ifdef ONE_LIGHT
#define LIGHT_COUNT 1
#else
#define LIGHT_COUNT count_of(frame_light_count())
#endif

STRUCT(Hit)
struct Hit {
    Real t;     // distance, INFINITE when nothing is hit
    Int object; // NO_OBJECT when nothing is hit
    Int from;   // face that the ray leaves, or NO_FACE
};

// First object along the ray; `origin_face` is the one that the ray leaves (or NO_FACE).
Hit closest_hit(SCENE_PARAMS Vec3 origin, Vec3 direction, Int origin_face) {
    Int origin_object = OBJECT_OF(origin_face);
    Bool behind = IS_BEHIND(origin_face);
    Hit hit;
    hit.t = lanes(INFINITE);
    hit.object = lanes_i(NO_OBJECT);
    hit.from = origin_face;
#ifdef HAS_SPHERES
    for (int i = 0; i < SPHERE_COUNT; i++) {
        Real t = hit_sphere(origin, direction, object_anchor_same(i), object_extent_same(i), origin_object == i, behind);
        Bool closer = t < hit.t;
        hit.t = pick(closer, t, hit.t);
        hit.object = pick_i(closer, i, hit.object);
    }
#endif
#ifdef HAS_PLANES
    for (int i = SPHERE_COUNT; i < SPHERE_COUNT + PLANE_COUNT; i++) {
        Real t = hit_plane(origin, direction, object_anchor_same(i), object_extent_same(i), origin_object == i);
        Bool closer = t < hit.t;
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
Bool occluded(SCENE_PARAMS Vec3 origin, Vec3 light, Vec3 direction, Real distance, Int origin_face, int target_object) {
    Int origin_object = OBJECT_OF(origin_face);
    // Half an ulp of the distance: a light that lies on a sphere is not shadowed by it.
    Real reach = distance * 0.9999999f;
    Bool blocked = NO_LANE;
#ifdef HAS_SPHERE_SHADOWS
    for (int i = 0; i < SPHERE_COUNT; i++) {
        if (i == target_object) continue;
        Real t = hit_sphere(origin, direction, object_anchor_same(i), object_extent_same(i), origin_object == i,
                            IS_BEHIND(origin_face));
        blocked = blocked || t < reach;
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
    Vec3 position; // scene space, back on the surface to an ulp
    Vec3 normal;   // unit, towards the side the ray came from
    Int object;
    Real side;     // +1 on the side that the stored normal points to, else −1
};

// What a ray that goes on from here leaves.
Int face_left(Surface surface) { return surface.object * 2 + pick_i(surface.side < 0.0f, 1, 0); }

#ifdef HAS_TWO_SIDED
// Sum of a point's coordinates: what rounding is measured by.
Real size_of(Vec3 p) { return fabs(p.x) + fabs(p.y) + fabs(p.z); }

#define MARGIN 1e-6f // of a point's size, eight ulps: so far from all other surfaces that its side is known
#define UNSURE 6e-7f // nearer than this it is moved; computing a side is wrong by 2.5e-7 at most

// A hit beside an edge or a contact may come to lie beyond the other surface, and a ray that goes on from there would
// leave a closed room. So it is put to the side of every other surface from which the ray came. (OBJECTS_ALONE: each
// object is a scene of its own, in `photile stress`.)
INLINE Vec3 keep_side(SCENE_PARAMS Vec3 origin, Vec3 direction, Hit hit, Vec3 position) {
    Real leaves = pick(IS_BEHIND(hit.from), -1.0f, 1.0f);
#ifdef HAS_SPHERES
    for (int i = 0; i < SPHERE_COUNT; i++) {
        Vec3 center = object_anchor_same(i);
        Real radius = object_extent_same(i);
        Vec3 away = sub3(position, center);
        Real radius2 = radius * radius;
        Real here = dot3(away, away) - radius2;
        Real reach = radius + size_of(position);
        Bool near_by = hit.object != i && fabs(here) < 4.0f * UNSURE * radius * reach;
        if (!any_lane(near_by)) continue;
        Vec3 before = sub3(origin, center);
        Real there = dot3(before, before) - radius2;
        // Of a camera on the sphere, the direction tells the side.
        there = pick(fabs(there) <= UNSURE * radius2, dot3(before, direction), there);
        there = pick(OBJECT_OF(hit.from) == i, leaves, copysign(lanes(1.0f), there));
        near_by = near_by && here * there < 2.0f * UNSURE * radius * reach;
        Real push = (there * MARGIN * reach - here / (2.0f * radius)) / radius;
        position = pick3(near_by, add3(position, scale3(away, push)), position);
    }
#endif
#ifdef HAS_PLANES
    for (int i = SPHERE_COUNT; i < SPHERE_COUNT + PLANE_COUNT; i++) {
        Vec3 normal = object_anchor_same(i);
        Real offset = object_extent_same(i);
        Real here = dot3(normal, position) - offset;
        Real there = dot3(normal, origin) - offset;
        there = pick(fabs(there) <= 2.5e-7f * size_of(origin), dot3(normal, direction), there);
        there = pick(OBJECT_OF(hit.from) == i, leaves, copysign(lanes(1.0f), there));
        Real size = size_of(position);
        Bool unsure = hit.object != i && here * there < UNSURE * size;
        position = pick3(unsure, add3(position, scale3(normal, there * MARGIN * size - here)), position);
    }
#endif
    return position;
}
#endif

INLINE Surface surface_at(SCENE_PARAMS Vec3 origin, Vec3 direction, Hit hit) {
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
#ifdef HAS_TWO_SIDED
#ifndef OBJECTS_ALONE
    surface.position = keep_side(SCENE origin, direction, hit, surface.position);
#endif
    Bool from_behind = dot3(surface.normal, direction) > 0.0f;
#ifdef HAS_SPHERES
    // Where a ray grazes a sphere that angle is rounding: where the ray starts tells, as it did the root.
    Vec3 from_center = sub3(origin, anchor);
    Bool inside = OBJECT_OF(hit.from) == hit.object || !(dot3(from_center, from_center) > extent * extent);
    from_behind = pick_b(hit.object < SPHERE_COUNT, inside, from_behind);
#endif
    surface.normal = pick3(from_behind, negate3(surface.normal), surface.normal);
    surface.side = pick(from_behind, -1.0f, 1.0f);
#else
    surface.side = lanes(1.0f);
#endif
    return surface;
}
