// Plane without an end: its anchor is the unit normal n, its extent the offset d of dot(n, p) = d.
#include "shared/shapes/flat.glsl"
#define plane_place flat_place
#define plane_met_behind flat_met_behind
#define plane_chart flat_chart

// `origin_on`: the ray starts on this plane.
Real hit_plane(Vec3 origin, Vec3 direction, Vec3 normal, Real offset, Bool origin_on) {
    Real slope = dot3(normal, direction);
    Real t = (offset - dot3(normal, origin)) / slope;
#ifdef HAS_TWO_SIDED
    // A parallel ray gives ±infinity or NaN, both refused here.
    Bool hit = t > 0.0f && t < INFINITE && !origin_on;
#else
    // Normals point to where the lights are (packing.rs).
    Bool hit = slope < 0.0f && !origin_on;
    t = max(t, lanes(LEAST_DISTANCE));
#endif
    return pick(hit, t, INFINITE);
}

// Plane i, the same for all lanes, along a ray. It is met from either side alike.
#define plane_hit(i, origin, direction, origin_on, behind) \
    hit_plane(origin, direction, shape_anchor_same(i), shape_extent_same(i), origin_on)

#ifdef HAS_TWO_SIDED
// A hit point of another shape, put to the side of plane i from which the ray came. `leaves`: −1 where the ray leaves
// the side that normals do not point to.
INLINE Vec3 plane_keep_side(SCENE_PARAMS int i, Vec3 origin, Vec3 direction, Hit hit, Real leaves, Vec3 position) {
    Vec3 normal = shape_anchor_same(i);
    Real offset = shape_extent_same(i);
    Real here = dot3(normal, position) - offset;
    Real there = dot3(normal, origin) - offset;
    there = pick(fabs(there) <= 2.5e-7f * size_of(origin), dot3(normal, direction), there);
    there = pick(SHAPE_OF(hit.from) == i, leaves, copysign(lanes(1.0f), there));
    Real size = size_of(position);
    Bool unsure = hit.shape != i && here * there < UNSURE * size;
    return pick3(unsure, add3(position, scale3(normal, there * MARGIN * size - here)), position);
}
#endif

#ifdef HAS_PLANE_SHADOWS
// Whether plane i comes between the origin and a light. By sides rather than distances, which lose all digits where a
// ray grazes a plane that the light lies on.
INLINE Bool plane_blocks(SCENE_PARAMS int i, Vec3 origin, Vec3 light, Vec3 direction, Real distance, Int origin_face) {
    Real offset = shape_extent_same(i);
    Real here = dot3(shape_anchor_same(i), origin) - offset;
    Real there = dot3(shape_anchor_same(i), light) - offset;
    // A light within rounding of the plane (a few ulps of the numbers that cancel) lies on it.
    Real size = sqrt(dot3(light, light));
    Bool behind = here * there < 0.0f && fabs(there) > 1e-6f * (size + fabs(offset));
    return behind && SHAPE_OF(origin_face) != i;
}
#endif

// A plane does not see itself, whatever rounding says.
#define PLANE_SEES_ITSELF false

#ifdef HAS_BOTH_SIDES
#define PLANE_PARTS
// Whether plane i lies between a point and a photon.
INLINE Bool plane_parts(SCENE_PARAMS int i, Vec3 point, Vec3 photon) {
    Vec3 normal = shape_anchor_same(i);
    Real extent = shape_extent_same(i);
    // Photons of the very edge count for both sides.
    return (extent - dot3(normal, point)) * (extent - dot3(normal, photon)) < 0.0f;
}
#endif

#ifdef HAS_SITES
// Distance from a point to plane i.
INLINE Real plane_distance(SCENE_PARAMS int i, Vec3 position) {
    return fabs(dot3(shape_anchor_same(i), position) - shape_extent_same(i));
}

// Normals are the same all over it.
INLINE Real plane_likeness(SCENE_PARAMS Int shape, Vec3 apart) { return lanes(1.0f); }
#endif

// A plane cuts other surfaces' discs once.
#define PLANE_CUTS 1
#ifdef HAS_CLIP
INLINE Cut plane_cut(SCENE_PARAMS int i, int number, Surface surface, Real inverse_radius) {
    return flat_cut(SCENE i, surface, inverse_radius);
}
#endif
