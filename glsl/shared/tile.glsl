// Screen-space tiles: rectangles of pixels, each with a list of the photons that can matter to what it sees.
//
// A tile's *region* is what its pixels see of one face (cell.glsl): the box of their visible points. A photon is on a
// region's list when it lies on that face and its disc of radius R can touch the box; the list is sorted into cells
// that cover the box. One cell makes a plain tile, more of them make a tile with a grid of its own.

#ifdef HAS_SHAPES
// Whether an object scatters photons' light towards the viewer at all.
Bool scatters(SCENE_PARAMS Int shape) {
    Vec3 color = material_color(MATERIAL_OF(shape));
    return max(max(color.x, color.y), color.z) * material_diffuse(MATERIAL_OF(shape)) > 0.0f || material_specular(MATERIAL_OF(shape)) > 0.0f;
}
#endif

#ifdef GATHER_TILES
// The tile that a pixel belongs to. Quotients of integers below 2²⁴ never round up to the next integer.
Int tile_at(SCENE_PARAMS Int column, Int row) {
    // Blocks of lanes may reach over the image's edge: those lanes take part in nothing.
    Real x = min(to_real(column), lanes(frame_width() - 1.0f));
    Real y = min(to_real(row), lanes(frame_height() - 1.0f));
    return to_int(y / gather_tile_height()) * count_of(gather_tiles_across()) + to_int(x / gather_tile_width());
}

// The region of a tile that holds a point of a face, −1 where there is none.
Int find_region(SCENE_PARAMS Int tile, Int face, Vec3 point, Bool wanted) {
    Int found = lanes_i(-1);
    Int at = to_int(tile_first(tile));
    Int end = at + to_int(tile_count(tile));
    Bool looking = wanted && at < end;
    if (any_lane(looking)) do { // as in gather.glsl, so that no round is for nothing
        Int own = pick_i(looking, at, 0);
        Bool same = looking && face == to_int(region_face(own));
        found = pick_i(same, own, found);
        at = at + 1;
        looking = looking && !same && at < end;
    } while (any_lane(looking));
    Int own = pick_i(found >= 0, found, 0);
    Vec3 low = region_low(own);
    Vec3 high = region_high(own);
    // Compilers round rays differently, most where these graze a surface. Lists reach farther than this (tiling.rs).
    Real slack = 1e-3f * gather_radius() + 5e-7f * (fabs(point.x) + fabs(point.y) + fabs(point.z));
    Bool inside = point.x >= low.x - slack && point.x <= high.x + slack && point.y >= low.y - slack &&
        point.y <= high.y + slack && point.z >= low.z - slack && point.z <= high.z + slack;
    return pick_i(found >= 0 && inside, found, -1);
}
#endif
