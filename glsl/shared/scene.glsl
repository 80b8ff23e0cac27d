// The scene as rays see it: what is asked of every shape, of one kind after the other. A block between `#each shape` and
// `#end each` stands once for each kind in the program's text, with `kind` and KIND for its name (program/kinds.rs).

#ifdef ONE_LIGHT
#define LIGHT_COUNT 1
#else
#define LIGHT_COUNT count_of(frame_light_count())
#endif

// First shape along the ray; `origin_face` is the one that the ray leaves (or NO_FACE).
Hit closest_hit(SCENE_PARAMS Vec3 origin, Vec3 direction, Int origin_face) {
    Int origin_shape = SHAPE_OF(origin_face);
    Bool behind = IS_BEHIND(origin_face);
    Hit hit;
    hit.t = lanes(INFINITE);
    hit.shape = lanes_i(NO_SHAPE);
    hit.from = origin_face;
#each shape
#ifdef HAS_KINDS
    for (int i = FIRST_KIND; i < END_KIND; i++) {
        Real t = kind_hit(i, origin, direction, origin_shape == i, behind);
        Bool closer = t < hit.t;
        hit.t = pick(closer, t, hit.t);
        hit.shape = pick_i(closer, i, hit.shape);
    }
#endif
#end each
    return hit;
}

#ifdef HAS_SHADOWS
// Whether anything lies between the origin and a light at `distance` along the ray, or a lit point on `target_shape`
// (NO_SHAPE for a light). Both ends face each other, so neither end's own shape, convex as all are, comes between.
// Kinds are only asked where one of them may be in the way (features.rs).
Bool occluded(SCENE_PARAMS Vec3 origin, Vec3 light, Vec3 direction, Real distance, Int origin_face, int target_shape) {
    Bool blocked = NO_LANE;
#each shape
#ifdef HAS_KIND_SHADOWS
    for (int i = FIRST_KIND; i < END_KIND; i++) {
        if (i == target_shape) continue;
        blocked = blocked || kind_blocks(SCENE i, origin, light, direction, distance, origin_face);
    }
#endif
#end each
    return blocked;
}
#endif

#ifdef HAS_TWO_SIDED
// A hit beside an edge or a contact may come to lie beyond the other surface, and a ray that goes on from there would
// leave a closed room. So it is put to the side of every other surface from which the ray came. (SHAPES_ALONE: each
// shape is a scene of its own, in `photile stress`.)
INLINE Vec3 keep_side(SCENE_PARAMS Vec3 origin, Vec3 direction, Hit hit, Vec3 position) {
    Real leaves = pick(IS_BEHIND(hit.from), -1.0f, 1.0f);
#each shape
#ifdef HAS_KINDS
    for (int i = FIRST_KIND; i < END_KIND; i++) {
        position = kind_keep_side(SCENE i, origin, direction, hit, leaves, position);
    }
#endif
#end each
    return position;
}
#endif

INLINE Surface surface_at(SCENE_PARAMS Vec3 origin, Vec3 direction, Hit hit) {
    Surface surface;
    surface.shape = hit.shape;
    Vec3 p = add3(origin, scale3(direction, hit.t));
    Vec3 anchor = shape_anchor(hit.shape);
    Real extent = shape_extent(hit.shape);
    // Rounding along a long ray leaves p off the surface: put it back, then nothing needs an offset.
#each shape
#ifdef HAS_KINDS
    Placed on_kind = kind_place(anchor, extent, p);
#ifdef KIND_COMES_FIRST
    surface.position = on_kind.position;
    surface.normal = on_kind.normal;
#else
    surface.position = pick3(IS_KIND(hit.shape), on_kind.position, surface.position);
    surface.normal = pick3(IS_KIND(hit.shape), on_kind.normal, surface.normal);
#endif
#endif
#end each
#ifdef HAS_TWO_SIDED
#ifndef SHAPES_ALONE
    surface.position = keep_side(SCENE origin, direction, hit, surface.position);
#endif
    Bool from_behind = NO_LANE;
#each shape
#ifdef HAS_KINDS
#ifdef KIND_COMES_FIRST
    from_behind = kind_met_behind(hit, origin, direction, anchor, extent);
#else
    from_behind = pick_b(IS_KIND(hit.shape), kind_met_behind(hit, origin, direction, anchor, extent), from_behind);
#endif
#endif
#end each
    surface.normal = pick3(from_behind, negate3(surface.normal), surface.normal);
    surface.side = pick(from_behind, -1.0f, 1.0f);
#else
    surface.side = lanes(1.0f);
#endif
    return surface;
}

#ifdef HAS_FINAL_GATHER
// Whether two points of one shape may see each other, whatever rounding says of their angles.
bool sees_itself(SCENE_PARAMS int shape) {
    bool sees = false;
#each shape
#ifdef HAS_KINDS
    sees = sees || (KIND_SEES_ITSELF && IS_KIND(shape));
#endif
#end each
    return sees;
}
#endif
