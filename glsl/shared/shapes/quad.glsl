// Quad: a parallelogram. Its anchor and extent are its plane's, as of a plane; its row of the table of quads has the two
// coordinates along its edges, each in [−1, 1] on the quad.
#include "shared/shapes/flat.glsl"
#define quad_place flat_place
#define quad_met_behind flat_met_behind
#define quad_chart flat_chart

#define QUAD_ROW(shape) ((shape) - FIRST_QUAD)
// Every row knows how many there are: frames have no room for it.
#define frame_quad_count() quad_count_scalar(0)

// So much of the numbers that cancel an edge is wider than the quad: a ray between two quads that share an edge meets one of
// them, whatever rounding says. Nor does one that starts beside a contact, which put its origin a MARGIN beyond its own
// surface (sphere_keep_side): hence a point's whole size counts, whichever way the edge lies.
#define QUAD_SLACK 1.5e-6f

// How far a coordinate that is `at` lies outside of the quad; 0 and less within. `across` is its gradient, `p` the point.
INLINE Real beyond_edge(Real at, Vec3 across, Real offset, Vec3 p) {
    Real size = size_of(across) * size_of(p) + fabs(offset) + 1.0f;
    return fabs(at) - 1.0f - QUAD_SLACK * size;
}

// Whether a point of the quad's plane lies on the quad.
INLINE Bool on_quad(Vec3 p, Vec3 across_u, Real offset_u, Vec3 across_v, Real offset_v) {
    Real u = dot3(across_u, p) + offset_u;
    Real v = dot3(across_v, p) + offset_v;
    return beyond_edge(u, across_u, offset_u, p) <= 0.0f && beyond_edge(v, across_v, offset_v, p) <= 0.0f;
}

#define ON_QUAD(i, p) on_quad(p, quad_across_u_same(QUAD_ROW(i)), quad_offset_u_same(QUAD_ROW(i)), \
                              quad_across_v_same(QUAD_ROW(i)), quad_offset_v_same(QUAD_ROW(i)))

// Quads have an edge that light goes round, so a scene with quads is always met from both sides.
INLINE Real hit_quad(SCENE_PARAMS int i, Vec3 origin, Vec3 direction, Bool origin_on) {
    Vec3 normal = shape_anchor_same(i);
    Real t = (shape_extent_same(i) - dot3(normal, origin)) / dot3(normal, direction);
    // A parallel ray gives ±infinity or NaN, both refused here.
    Bool hit = t > 0.0f && t < INFINITE && !origin_on;
    if (!any_lane(hit)) return lanes(INFINITE);
    Vec3 p = add3(origin, scale3(direction, pick(hit, t, 0.0f)));
    return pick(hit && ON_QUAD(i, p), t, INFINITE);
}

#define quad_hit(i, origin, direction, origin_on, behind) hit_quad(SCENE i, origin, direction, origin_on)

// A hit point of another shape beside quad i, put to the side of it from which the ray came. `leaves`: −1 where the ray
// leaves the side that normals do not point to.
INLINE Vec3 quad_keep_side(SCENE_PARAMS int i, Vec3 origin, Vec3 direction, Hit hit, Real leaves, Vec3 position) {
    Vec3 normal = shape_anchor_same(i);
    Real offset = shape_extent_same(i);
    Real here = dot3(normal, position) - offset;
    Real there = dot3(normal, origin) - offset;
    there = pick(fabs(there) <= 2.5e-7f * size_of(origin), dot3(normal, direction), there);
    there = pick(SHAPE_OF(hit.from) == i, leaves, copysign(lanes(1.0f), there));
    Real size = size_of(position);
    // Of the quad's plane only what is near the quad itself; far from it `here` is far from 0 on one side, and may be. A ray
    // that starts a MARGIN beyond a wall, beside a contact, may end as far beyond it.
    Real near_by = 4.0f * UNSURE * max(size, size_of(origin));
    Bool unsure = hit.shape != i && here * there < UNSURE * size && fabs(here) < near_by;
    if (!any_lane(unsure)) return position;
    unsure = unsure && ON_QUAD(i, position);
    return pick3(unsure, add3(position, scale3(normal, there * MARGIN * size - here)), position);
}

#ifdef HAS_QUAD_SHADOWS
// Whether quad i comes between the origin and a light: by sides, as a plane, and where the way crosses its plane.
INLINE Bool quad_blocks(SCENE_PARAMS int i, Vec3 origin, Vec3 light, Vec3 direction, Real distance, Int origin_face) {
    Real offset = shape_extent_same(i);
    Real here = dot3(shape_anchor_same(i), origin) - offset;
    Real there = dot3(shape_anchor_same(i), light) - offset;
    // A light within rounding of the plane (a few ulps of the numbers that cancel) lies on it.
    Real size = sqrt(dot3(light, light));
    Bool behind = here * there < 0.0f && fabs(there) > 1e-6f * (size + fabs(offset)) && SHAPE_OF(origin_face) != i;
    if (!any_lane(behind)) return behind;
    Real share = pick(behind, here / (here - there), 0.0f);
    return behind && ON_QUAD(i, add3(origin, scale3(sub3(light, origin), share)));
}
#endif

#ifdef HAS_BOTH_SIDES
#define QUAD_PARTS
// Whether the way from a point to a photon crosses quad i.
INLINE Bool quad_parts(SCENE_PARAMS int i, Vec3 point, Vec3 photon) {
    Vec3 normal = shape_anchor_same(i);
    Real extent = shape_extent_same(i);
    Real here = extent - dot3(normal, point);
    Real there = extent - dot3(normal, photon);
    // Photons of the very edge count for both sides.
    Bool parted = here * there < 0.0f;
    if (!any_lane(parted)) return parted;
    Real share = pick(parted, here / (here - there), 0.0f);
    return parted && ON_QUAD(i, add3(point, scale3(sub3(photon, point), share)));
}
#endif

// Flat shapes do not see themselves, whatever rounding says.
#define QUAD_SEES_ITSELF false

#ifdef HAS_SITES
// Distance from a point to quad i; of a slanted one's corners a little more.
INLINE Real quad_distance(SCENE_PARAMS int i, Vec3 position) {
    Vec3 across_u = quad_across_u_same(QUAD_ROW(i));
    Vec3 across_v = quad_across_v_same(QUAD_ROW(i));
    Real off = dot3(shape_anchor_same(i), position) - shape_extent_same(i);
    Real u = max(fabs(dot3(across_u, position) + quad_offset_u_same(QUAD_ROW(i))) - 1.0f, lanes(0.0f));
    Real v = max(fabs(dot3(across_v, position) + quad_offset_v_same(QUAD_ROW(i))) - 1.0f, lanes(0.0f));
    return sqrt(off * off + u * u / dot3(across_u, across_u) + v * v / dot3(across_v, across_v));
}

INLINE Real quad_likeness(SCENE_PARAMS Int shape, Vec3 apart) { return lanes(1.0f); }
#endif

// Four edges cut a quad's own discs, and the first stands for the quad as a wall of others.
#define QUAD_CUTS 4
#ifdef HAS_CLIP
// Edge e of quad i where the point lies on that quad: exact. Of another quad, by its edge 0, its plane's line, where the
// quad reaches over the whole chord: a wall. (A wall that ends within the disc cuts nothing.)
INLINE Cut quad_cut(SCENE_PARAMS int i, int e, Surface surface, Real inverse_radius) {
    bool along_u = e < 2;
    Vec3 across = along_u ? quad_across_u_same(QUAD_ROW(i)) : quad_across_v_same(QUAD_ROW(i));
    Real at = dot3(across, surface.position) + (along_u ? quad_offset_u_same(QUAD_ROW(i)) : quad_offset_v_same(QUAD_ROW(i)));
    float sign = (e & 1) == 0 ? 1.0f : -1.0f;
    Real steep = 1.0f / sqrt(dot3(across, across));
    Cut cut;
    cut.across = scale3(across, steep * sign);
    cut.sine2 = lanes(1.0f);
    cut.beyond = max((1.0f - sign * at) * steep * inverse_radius, lanes(1e-12f));
    if (e > 0) {
        cut.beyond = pick(surface.shape == i, cut.beyond, INFINITE);
        return cut;
    }
    Bool own = surface.shape == i;
    Cut wall = flat_cut(SCENE i, surface, inverse_radius);
    if (any_lane(!own)) {
        // The chord's ends.
        Real slope = 1.0f / sqrt(max(wall.sine2, lanes(1e-12f)));
        Real h = min(wall.beyond * slope, lanes(1.0f));
        Vec3 towards = scale3(wall.across, slope / inverse_radius);
        Vec3 along = scale3(cross3(surface.normal, towards), sqrt(max(1.0f - h * h, lanes(0.0f))));
        Vec3 foot = add3(surface.position, scale3(towards, h));
        Bool spans = ON_QUAD(i, add3(foot, along)) && ON_QUAD(i, sub3(foot, along));
        wall.beyond = pick(spans, wall.beyond, INFINITE);
    }
    cut.across = pick3(own, cut.across, wall.across);
    cut.sine2 = pick(own, cut.sine2, wall.sine2);
    cut.beyond = pick(own, cut.beyond, wall.beyond);
    return cut;
}
#endif
