// Sphere: its anchor is the centre, its extent the radius; its normal points outwards.

// Nearest root in front of the origin. The discriminant comes from the ray's closest approach rather than from
// b² − c, which cancels for small or far spheres (Haines et al., Ray Tracing Gems, ch. 7). The way to that approach is
// taken twice, the second time from where the first one ended: its own rounding goes, and that of the direction, whose
// length is 1 to an ulp only. Roots are then within 4 ulps of the largest length, up to 60° from the normal; taking the
// smaller one as c / larger, as is usual, costs a division and gives 5.
//
// `origin_on`: the ray starts on this sphere, and with `behind` it leaves on the side that normals do not point to.
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

// Sphere i, the same for all lanes, along a ray.
#define sphere_hit(i, origin, direction, origin_on, behind) \
    hit_sphere(origin, direction, shape_anchor_same(i), shape_extent_same(i), origin_on, behind)

// A hit point p put back on the sphere.
INLINE Placed sphere_place(Vec3 center, Real radius, Vec3 p) {
    Placed placed;
    placed.normal = normalize3(sub3(p, center));
    placed.position = add3(center, scale3(placed.normal, radius));
    return placed;
}

#ifdef HAS_TWO_SIDED
// Whether the sphere was met from within. Where a ray grazes it the angle is rounding: where the ray starts tells, as it
// did the root.
INLINE Bool sphere_met_behind(Hit hit, Vec3 origin, Vec3 direction, Vec3 center, Real radius) {
    Vec3 from_center = sub3(origin, center);
    return SHAPE_OF(hit.from) == hit.shape || !(dot3(from_center, from_center) > radius * radius);
}

// A hit point of another shape, put to the side of sphere i from which the ray came. `leaves`: −1 where the ray leaves
// the side that normals do not point to.
INLINE Vec3 sphere_keep_side(SCENE_PARAMS int i, Vec3 origin, Vec3 direction, Hit hit, Real leaves, Vec3 position) {
    Vec3 center = shape_anchor_same(i);
    Real radius = shape_extent_same(i);
    Vec3 away = sub3(position, center);
    Real radius2 = radius * radius;
    Real here = dot3(away, away) - radius2;
    Real reach = radius + size_of(position);
    Bool near_by = hit.shape != i && fabs(here) < 4.0f * UNSURE * radius * reach;
    if (!any_lane(near_by)) return position;
    Vec3 before = sub3(origin, center);
    Real there = dot3(before, before) - radius2;
    // Of a camera on the sphere, the direction tells the side.
    there = pick(fabs(there) <= UNSURE * radius2, dot3(before, direction), there);
    there = pick(SHAPE_OF(hit.from) == i, leaves, copysign(lanes(1.0f), there));
    near_by = near_by && here * there < 2.0f * UNSURE * radius * reach;
    Real push = (there * MARGIN * reach - here / (2.0f * radius)) / radius;
    return pick3(near_by, add3(position, scale3(away, push)), position);
}
#endif

#ifdef HAS_SPHERE_SHADOWS
// Whether sphere i comes between the origin and a light at `distance`.
INLINE Bool sphere_blocks(SCENE_PARAMS int i, Vec3 origin, Vec3 light, Vec3 direction, Real distance, Int origin_face) {
    // Half an ulp of the distance: a light that lies on a sphere is not shadowed by it.
    Real reach = distance * 0.9999999f;
    return sphere_hit(i, origin, direction, SHAPE_OF(origin_face) == i, IS_BEHIND(origin_face)) < reach;
}
#endif

// Whether a point of the sphere can be seen from another one of it: from within.
#define SPHERE_SEES_ITSELF true

#ifdef HAS_SITES
// Distance from a point to sphere i's surface.
INLINE Real sphere_distance(SCENE_PARAMS int i, Vec3 position) {
    Vec3 from_center = sub3(position, shape_anchor_same(i));
    return fabs(sqrt(dot3(from_center, from_center)) - shape_extent_same(i));
}

// How much a site counts for its normal's sake. Irradiance turns with it: full weight to none over 18 degrees, the chord
// of 0.316 radii.
INLINE Real sphere_likeness(SCENE_PARAMS Int shape, Vec3 apart) {
    Real radius = shape_extent(shape) * lattice_reach();
    Real turned = dot3(apart, apart) / (radius * radius);
    return max(1.0f - 10.0f * turned, lanes(0.0f));
}
#endif

#ifdef HAS_CHARTS
// Octahedral coordinates of a unit vector, in [−1, 1]²: no trigonometry, and every fold lies on a cell's border or
// its diagonal (Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014).
INLINE ChartPoint octahedral(Vec3 n) {
    Real scale = 1.0f / (fabs(n.x) + fabs(n.y) + fabs(n.z));
    ChartPoint o;
    o.u = n.x * scale;
    o.v = n.z * scale;
    Real folded_u = copysign(1.0f - fabs(o.v), o.u);
    Real folded_v = copysign(1.0f - fabs(o.u), o.v);
    Bool below = n.y < 0.0f;
    o.u = pick(below, folded_u, o.u);
    o.v = pick(below, folded_v, o.v);
    return o;
}

INLINE ChartPoint sphere_chart(SCENE_PARAMS Surface surface) { return octahedral(scale3(surface.normal, surface.side)); }
#endif

#ifdef HAS_FOOTPRINTS
// What sphere i, where it cuts the plane that the point lies on, covers of the disc.
INLINE Real sphere_footprint(SCENE_PARAMS int i, Surface surface, Real inverse_radius) {
    Vec3 away = sub3(shape_anchor_same(i), surface.position);
    Real radius = shape_extent_same(i);
    Real height = dot3(away, surface.normal);
    Vec3 across = sub3(away, scale3(surface.normal, height));
    Real distance = sqrt(dot3(across, across)) * inverse_radius;
    Real rho = sqrt(max(radius * radius - height * height, lanes(0.0f))) * inverse_radius;
    Bool covers = !IS_SPHERE(surface.shape) && rho > 0.0f && distance > rho && distance - rho < 1.0f;
    if (!any_lane(covers)) return lanes(0.0f);
    return pick(covers, covered_by_circle(pick(covers, distance, 1.0f), pick(covers, rho, 0.5f)), 0.0f);
}
#endif

#ifdef HAS_CLIP
// Distance of a plane's cut from a point on the sphere, in radii of the disc: on a sphere the plane cuts a circle.
// Lambert's equal-area map of the sphere around the point keeps areas and chordal distances, hence the kernel; in it the
// circle is taken as straight at its nearest point. `normal` is the plane's, `offset` its distance from the point.
INLINE Real sphere_cut(SCENE_PARAMS Int shape, Vec3 position, Vec3 normal, Real offset, Real inverse_radius) {
    Real radius = shape_extent(shape);
    Vec3 center = shape_anchor(shape);
    Vec3 outward = scale3(sub3(position, center), 1.0f / radius);
    Real point_cosine = dot3(normal, outward);
    Real circle_cosine = offset / radius + point_cosine;
    Real point_sine = sqrt(max(1.0f - point_cosine * point_cosine, lanes(0.0f)));
    Real circle_sine = sqrt(max(1.0f - circle_cosine * circle_cosine, lanes(0.0f)));
    // 2(1 − cos(A − B)), written without cancellation: the squared distance of two points of a unit circle.
    Real dc = point_cosine - circle_cosine;
    Real ds = point_sine - circle_sine;
    Real chordal = sqrt(dc * dc + ds * ds) * radius * inverse_radius;
    // A circle of less than R/20 takes 1/400 of the disc at most, and no chord at all resembles it; a sphere that
    // just touches the plane has one or none by the last bit.
    return pick(circle_sine * radius * inverse_radius > 0.05f, chordal, INFINITE);
}
#endif

// Spheres cover circles of flat surfaces (above) rather than cut them.
#define SPHERE_CUTS 0
