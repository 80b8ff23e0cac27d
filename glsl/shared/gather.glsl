// Radiance from the photon map: Σ f·ΔΦ·K(d/R) / R², divided by the part of ∫K that planes leave of the disc.
// Jensen, "Realistic Image Synthesis Using Photon Mapping", 2001, ch. 7.
//
// Lanes of one work-item are neighbouring pixels. They walk together over the photons near all of them, and each
// photon is loaded once and weighed by every lane: no lane waits for another's loop, no sum goes across lanes.

#ifdef HAS_PHOTONS
// A draw may gather every n-th candidate only, and the next draw the others: some drivers end long loops early, and
// say nothing (llvmpipe after 65,535 rounds of all loops together).
#ifdef SLICED
#define SLICE count_of(gather_slice())
#define SLICES count_of(gather_slices())
#else
#define SLICE 0
#define SLICES 1
#endif

STRUCT(Gathered)
struct Gathered {
    Vec3 flux;  // Σ ΔΦ·K/K(0), watts
#ifdef HAS_GLOSSY
    Vec3 glint; // Σ ΔΦ·K/K(0)·(GGX lobe), W/sr
#endif
#ifdef GATHER_KNN
    Real inverse_radius; // of the disc that the photons span, 1/m
#endif
#ifdef GATHER_GROUP
    int queued; // photons of the group's queue that are not weighed yet
#endif
};

// What a photon is weighed against: the point and, for glossy lobes, the viewer.
STRUCT(Query)
struct Query {
    Surface surface;
    Vec3 to_viewer;
    Real alpha; // GGX α
};

Gathered nothing_gathered() {
    Gathered none;
    none.flux = make3(lanes(0.0f), lanes(0.0f), lanes(0.0f));
#ifdef HAS_GLOSSY
    none.glint = none.flux;
#endif
#ifdef GATHER_GROUP
    none.queued = 0;
#endif
    return none;
}

// Sums stall where they outgrow their terms (a million photons of mixed power: 5e-4 too little): photons are summed
// in blocks, and blocks then.
#define SUM_BLOCK 256

Gathered add_gathered(Gathered sum, Gathered part) {
    sum.flux = add3(sum.flux, part.flux);
#ifdef HAS_GLOSSY
    sum.glint = add3(sum.glint, part.glint);
#endif
    return sum;
}

#ifdef HAS_BOTH_SIDES
// Whether a wall lies between the point and a photon: that photon lights another room's part of the surface.
Bool walled_off(SCENE_PARAMS Surface surface, Vec3 photon) {
    Bool off = NO_LANE;
#each shape
#if defined(HAS_KINDS) && defined(KIND_PARTS)
    // Both lie on the surface itself: which side of it rounding puts them on says nothing.
    for (int i = FIRST_KIND; i < END_KIND; i++)
        off = off || (surface.shape != i && kind_parts(SCENE i, surface.position, photon));
#endif
#end each
    return off;
}
#endif

// Adds a photon's light with a weight of K/K(0).
Gathered add_light(SCENE_PARAMS Gathered sum, Real weight, Vec3 position, Vec3 power, Vec3 to_light, Query query) {
#ifdef HAS_BOTH_SIDES
    weight = pick(walled_off(SCENE query.surface, position), 0.0f, weight);
#endif
    sum.flux = scale_add3(power, weight, sum.flux);
#ifdef HAS_GLOSSY
    // At the rim of a curved surface a photon may come from below the query point's horizon.
    Real cos_i = dot3(query.surface.normal, to_light);
    Real cos_o = max(dot3(query.surface.normal, query.to_viewer), lanes(0.0f));
    Real lobe = ggx(query.surface.normal, query.to_viewer, to_light, cos_o, max(cos_i, lanes(0.0f)), query.alpha);
    sum.glint = scale_add3(power, pick(cos_i > 0.0f, weight * lobe, 0.0f), sum.glint);
#endif
    return sum;
}

// The same of photon i.
Gathered add_photon(SCENE_PARAMS Gathered sum, int i, Real weight, Vec3 position, Query query) {
    Vec3 power = photon_power_same(i);
#ifdef HAS_GLOSSY
    Vec3 to_light = photon_direction_same(i);
#else
    Vec3 to_light = power; // nobody asks
#endif
    return add_light(SCENE sum, weight, position, power, to_light, query);
}

// Most candidates weigh something: a test that spares the others costs more than they do, unless photons are dear.
#if defined(HAS_GLOSSY) || defined(HAS_BOTH_SIDES)
#define DEAR_PHOTONS
#endif

#ifdef GATHER_KNN
#define KNN_MAX 256 // most that --k takes; a heap this long is 2 KiB a lane
#if LANES > 1
#error "k nearest photons are gathered with one lane a work-item: a heap holds one query's photons"
#endif
#endif
// What gather_face walks over: a face of the grid, or a tile's region.
#ifdef GATHER_TILES
#define AREA_FLIPPED(i) region_flipped_scalar(i)
#define AREA_ORIGIN(i) region_origin_scalar(i)
#define AREA_COUNTS(i) region_counts_scalar(i)
#define AREA_BASE(i) region_base_scalar(i)
#define AREA_CELL(i) region_cell_scalar(i)
#define AREA_INVERSE_CELL(i) region_inverse_cell_scalar(i)
#define AREA_SHAPE(i) (count_of(region_face_scalar(i)) / 2)
#define AREA_BY_ROWS 0.0f
#define PHOTON_AT(place) count_of(tile_photon(place))
#else
#define AREA_FLIPPED(i) face_flipped_scalar(i)
#define AREA_ORIGIN(i) face_origin_scalar(i)
#define AREA_COUNTS(i) face_counts_scalar(i)
#define AREA_BASE(i) face_base_scalar(i)
#define AREA_TABLE(i) face_table_scalar(i)
#define AREA_CELL(i) gather_cell_scalar()
#define AREA_INVERSE_CELL(i) gather_inverse_cell_scalar()
#define AREA_SHAPE(i) ((i) / 2)
#define AREA_BY_ROWS gather_by_rows()
#define PHOTON_AT(place) (place)
#endif

#ifdef GATHER_GROUP
// In group.cl: work-items take photons from memory together.
Gathered queue_photons(SCENE_PARAMS Gathered sum, int first, int end, CELL_ROW_PARAM Query query);
Gathered weigh_queue(SCENE_PARAMS Gathered sum, Query query);
Gathered gather_group(SCENE_PARAMS Query query, int face, int wanted);
#endif

#ifndef GATHER_BRUTE
// Whether an object's surface passes through a box: where it does not, there are no photons of it.
bool passes_through(bool is_sphere, Float3 anchor, float extent, Float3 low, Float3 high) {
    Float3 away = (low + high) * 0.5f - (is_sphere ? anchor : triple(0.0f, 0.0f, 0.0f));
    Float3 reach = (high - low) * 0.5f;
    if (!is_sphere) return fabs(dot(anchor, away) - extent) <= dot(fabs(anchor), reach);
    Float3 nearest = max(fabs(away) - reach, triple(0.0f, 0.0f, 0.0f));
    Float3 farthest = fabs(away) + reach;
    return dot(nearest, nearest) <= extent * extent && dot(farthest, farthest) >= extent * extent;
}

#if !defined(GATHER_GROUP) && !defined(GATHER_KNN)
// Adds the photons of a row: places [place, end), one at least, of the grid or of a tile's list.
INLINE Gathered weigh_run(SCENE_PARAMS Gathered sum, int place, int end, CELL_ROW_PARAM Query query) {
    Real inverse_radius2 = lanes(gather_inverse_radius() * gather_inverse_radius());
    do {
        Gathered part = nothing_gathered();
        int stop = min(end, place + SUM_BLOCK * SLICES);
        do {
            int i = PHOTON_AT(place);
            place += SLICES;
            Vec3 position = photon_position_same(i);
            Vec3 away = sub3(position, query.surface.position);
            Real weight = kernel_shape(square3(away), inverse_radius2);
#ifdef DEAR_PHOTONS
            if (!any_lane(weight > 0.0f)) continue;
#endif
#ifdef GRID_HASHED
            if (!is_in_row(row, photon_position_scalar(i))) continue;
#endif
            part = add_photon(SCENE part, i, weight, position, query);
        } while (place < stop);
        sum = add_gathered(sum, part);
    } while (place < end);
    return sum;
}

// CPUs list runs of photons before they weigh them: a branch is guessed wrongly wherever a run ends, and what comes next
// must not wait for its row's geometry then. (On two cores R = 0.1 takes a tenth less in the box, and a quarter less in
// sphere_and_plane, whose rows are hashed.)
#if LANES > 1
#define RUNS 32
#ifdef GRID_HASHED
#define RUN_ROW(r) run_row[r],
#else
#define RUN_ROW(r)
#endif
#define WEIGH_RUNS \
    for (int r = 0; r < runs; r++) sum = weigh_run(SCENE sum, run_first[r], run_end[r], RUN_ROW(r) query)
#endif
#endif

// Photons of one face (or region) around the lanes' points, which lie in the box from low to high.
Gathered gather_face(SCENE_PARAMS int face, Query query, Float3 low, Float3 high) {
    Gathered sum = nothing_gathered();
#ifdef GATHER_KNN
    sum.inverse_radius = gather_inverse_radius();
#endif
    float flipped = AREA_FLIPPED(face);
    Float3 origin = AREA_ORIGIN(face);
    Float3 cell = cell_axes(AREA_CELL(face), flipped, AREA_BY_ROWS);
    Float3 inverse = cell_axes(AREA_INVERSE_CELL(face), flipped, AREA_BY_ROWS);
    // Wider than the radius by more than coordinates round, so that the distance alone decides.
    float size = fabs(low.x) + fabs(low.y) + fabs(low.z) + fabs(high.x) + fabs(high.y) + fabs(high.z);
    float reach = gather_radius() * 1.0005f + 5e-7f * (size + fabs(origin.x) + fabs(origin.y) + fabs(origin.z));
    low = grid_axes(low, flipped);
    high = grid_axes(high, flipped);
#ifdef GRID_HASHED
    // The same for coordinates along rows alone: the hash counts on it.
    float along = gather_radius() * 1.0005f + 5e-7f * (fabs(low.x) + fabs(high.x));
#endif
    low = low - origin;
    high = high - origin;
    int v_first = cell_along(low.y - reach, inverse.y);
    int v_last = cell_along(high.y + reach, inverse.y);
    int w_first = cell_along(low.z - reach, inverse.z);
    int w_last = cell_along(high.z + reach, inverse.z);
#ifdef GRID_HASHED
    int mask = count_of(gather_bucket_mask());
    int base = count_of(AREA_BASE(face)), table = count_of(AREA_TABLE(face));
#else
    Float3 counts = AREA_COUNTS(face);
    v_first = max(v_first, 0);
    v_last = min(v_last, count_of(counts.y) - 1);
    w_first = max(w_first, 0);
    w_last = min(w_last, count_of(counts.z) - 1);
#endif
    // Rows of cells which the surface does not pass through are left out, where there are such: a box filled with cells
    // has none where the surface lies along its axes.
    int shape = AREA_SHAPE(face);
    bool is_sphere = IS_SPHERE(shape);
    Float3 anchor = grid_axes(shape_anchor_scalar(shape), flipped);
    float extent = shape_extent_scalar(shape) - (is_sphere ? 0.0f : dot(anchor, origin));
    if (is_sphere) anchor = anchor - origin;
    float slack = reach - gather_radius();
#ifdef GRID_HASHED
    // No box of the face's photons bounds its cells: where a plane lies across rows, only those are asked for through which
    // it passes. (Of planes that lie nearly along them each row is asked below.)
    if (!is_sphere) {
        Float3 middle = (low + high) * 0.5f, half_size = (high - low) * 0.5f + reach;
        Float3 steep = fabs(anchor);
        float off = extent - dot(anchor, middle), spread = dot(steep, half_size);
        if (steep.y > 0.1f) {
            float at = middle.y + off / anchor.y, aside = spread / steep.y - half_size.y + slack;
            v_first = max(v_first, cell_along(at - aside, inverse.y));
            v_last = min(v_last, cell_along(at + aside, inverse.y));
        }
        if (steep.z > 0.1f) {
            float at = middle.z + off / anchor.z, aside = spread / steep.z - half_size.z + slack;
            w_first = max(w_first, cell_along(at - aside, inverse.z));
            w_last = min(w_last, cell_along(at + aside, inverse.z));
        }
    }
#else
    bool may_be_empty = counts.y > 1.0f && counts.z > 1.0f;
#endif
#ifdef RUNS
    int run_first[RUNS], run_end[RUNS];
#ifdef GRID_HASHED
    Row run_row[RUNS];
#endif
    int runs = 0;
#endif
#ifdef GATHER_KNN
    Real inverse_radius2 = lanes(gather_inverse_radius() * gather_inverse_radius());
    // Binary heap of the nearest so far, the farthest of them at its root: one more than k, whose distance becomes
    // the radius. Counting the k others over that disc is unbiased (Moore & Yackel 1977).
    float heap_d2[KNN_MAX + 1];
    int heap_photon[KNN_MAX + 1];
    int capacity = min(count_of(gather_nearest()), KNN_MAX) + 1;
    int held = 0;
#endif
    // Loops ask at their end whether to go on, wherever they are entered only where there is something: software GLs, which
    // mask what a lane does not take part in, go once more through a body whose loop asks at its beginning. After such a
    // loop only what it sums up may be used: llvmpipe computes the rest anew for lanes that have left, as long as others
    // stay, from counters that have moved on.
    int w = w_first;
    if (v_first <= v_last && w_first <= w_last) do {
        float w_low = float_of(w) * cell.z;
        float w_gap = max(max(w_low - high.z, low.z - (w_low + cell.z)), 0.0f);
#ifdef GRID_HASHED
        if (is_endless(w)) w_gap = 0.0f;
#endif
        float w_left = reach * reach - w_gap * w_gap;
        int v = v_first;
        do {
            // Along the row only what the ball's chord reaches, and nothing where the surface does not pass through it.
            float v_low = float_of(v) * cell.y;
            float v_gap = max(max(v_low - high.y, low.y - (v_low + cell.y)), 0.0f);
#ifdef GRID_HASHED
            bool may_be_empty = !is_endless(v) && !is_endless(w);
            if (is_endless(v)) v_gap = 0.0f;
#endif
            float chord = sqrt(max(w_left - v_gap * v_gap, 0.0f));
#ifdef GRID_HASHED
            chord = min(chord, along);
#endif
            Float3 row_low = triple(low.x - chord, v_low, w_low) - slack;
            Float3 row_high = triple(high.x + chord, v_low + cell.y, w_low + cell.z) + slack;
            bool empty = may_be_empty && !passes_through(is_sphere, anchor, extent, row_low, row_high);
            int u_first = cell_along(low.x - chord, inverse.x);
            int u_last = cell_along(high.x + chord, inverse.x);
#ifdef GRID_HASHED
            // A row longer than the table would meet its photons twice.
            u_last = min(u_last, u_first + mask);
            int start = row_start(base, v, w);
            Row row = row_of(v, w, inverse, flipped);
            // A row that runs over the table's end goes on at its start.
            int u = u_first;
            if (!empty) do {
                int bucket = (start + u) & mask;
                int length = min(u_last - u + 1, mask + 1 - bucket);
                u += length;
                bucket += table;
#else
            u_first = max(u_first, 0);
            u_last = min(u_last, count_of(counts.x) - 1);
            int bucket = row_start(count_of(AREA_BASE(face)), v, w, counts) + u_first;
            int length = u_last - u_first + 1;
            if (length > 0 && !empty) {
#endif
                int end = count_of(cell_start(bucket + length));
                int place = count_of(cell_start(bucket)) + SLICE;
#if defined(GATHER_GROUP)
                sum = queue_photons(SCENE sum, place, end, CELL_ROW query);
#elif defined(GATHER_KNN)
                if (place < end) do {
                    int i = PHOTON_AT(place);
                    place += SLICES;
                    Vec3 position = photon_position_same(i);
                    float d2 = square3(sub3(position, query.surface.position));
                    if (d2 * inverse_radius2 >= 1.0f) continue;
#ifdef GRID_HASHED
                    if (!is_in_row(row, position)) continue;
#endif
#ifdef HAS_BOTH_SIDES
                    if (walled_off(SCENE query.surface, position)) continue;
#endif
                    int hole = -1;
                    if (held < capacity) {
                        hole = held;
                        held++;
                        while (hole > 0 && heap_d2[(hole - 1) / 2] < d2) {
                            heap_d2[hole] = heap_d2[(hole - 1) / 2];
                            heap_photon[hole] = heap_photon[(hole - 1) / 2];
                            hole = (hole - 1) / 2;
                        }
                    } else if (d2 < heap_d2[0]) {
                        hole = 0;
                        int child = 1;
                        while (child < capacity) {
                            if (child + 1 < capacity && heap_d2[child + 1] > heap_d2[child]) child++;
                            if (heap_d2[child] <= d2) break;
                            heap_d2[hole] = heap_d2[child];
                            heap_photon[hole] = heap_photon[child];
                            hole = child;
                            child = 2 * hole + 1;
                        }
                    }
                    if (hole >= 0) {
                        heap_d2[hole] = d2;
                        heap_photon[hole] = i;
                    }
                } while (place < end);
#elif defined(RUNS)
                run_first[runs] = place;
                run_end[runs] = end;
#ifdef GRID_HASHED
                run_row[runs] = row;
#endif
                runs += place < end ? 1 : 0;
                if (runs == RUNS) {
                    WEIGH_RUNS;
                    runs = 0;
                }
#else
                if (place < end) sum = weigh_run(SCENE sum, place, end, CELL_ROW query);
#endif
#ifdef GRID_HASHED
            } while (u <= u_last);
#else
            }
#endif
            v++;
        } while (v <= v_last);
        w++;
    } while (w <= w_last);
#ifdef GATHER_KNN
    // Fewer than k within R: they span the whole disc.
    if (held == capacity) sum.inverse_radius = 1.0f / sqrt(max(heap_d2[0], 1e-30f));
    for (int h = held == capacity ? 1 : 0; h < held; h++) {
        Real weight = kernel_shape(heap_d2[h], sum.inverse_radius * sum.inverse_radius);
        sum = add_photon(SCENE sum, heap_photon[h], weight, photon_position_same(heap_photon[h]), query);
    }
#endif
#ifdef GATHER_GROUP
    sum = weigh_queue(SCENE sum, query);
#endif
#ifdef RUNS
    WEIGH_RUNS;
#endif
    return sum;
}

// Photons of the lanes' faces (or regions), one after the other.
Gathered gather_near(SCENE_PARAMS Query query, Int face, Bool wanted) {
#if defined(GATHER_GROUP)
    return gather_group(SCENE query, face, wanted);
#elif LANES == 1
    Gathered sum = nothing_gathered();
#ifdef GATHER_KNN
    sum.inverse_radius = 1.0f;
#endif
    if (wanted) sum = gather_face(SCENE face, query, query.surface.position, query.surface.position);
    return sum;
#else
    Gathered sum = nothing_gathered();
    Vec3 p = query.surface.position;
    // Lanes farther apart than this have little in common: they walk on their own.
    float spread = gather_radius() * GATHER_SPREAD;
    Bool waiting = wanted;
    while (any_lane(waiting)) {
        int chosen = highest_i(waiting, face);
        Bool together = waiting && face == chosen;
        float low_x = lowest(together, p.x);
        together = together && p.x <= low_x + spread;
        float low_y = lowest(together, p.y);
        together = together && p.y <= low_y + spread;
        float low_z = lowest(together, p.z);
        together = together && p.z <= low_z + spread;
        Float3 low = triple(low_x, low_y, low_z);
        Float3 high = triple(highest(together, p.x), highest(together, p.y), highest(together, p.z));
        // Lanes that do not take part stand where no photon is.
        query.surface.position = pick3(together, p, make3(lanes(1e18f), lanes(1e18f), lanes(1e18f)));
        Gathered part = gather_face(SCENE chosen, query, low, high);
        sum = add_gathered(sum, part);
        waiting = waiting && !together;
    }
    return sum;
#endif
}
#endif

#if defined(GATHER_BRUTE) || defined(GATHER_TILES)
// Every photon of the map, as it was stored: the truth that grids and tiles are tested against.
Gathered gather_all(SCENE_PARAMS Query query, Int face, Bool wanted) {
    Gathered sum = nothing_gathered();
    Real inverse_radius2 = lanes(gather_inverse_radius() * gather_inverse_radius());
    int end = count_of(gather_photon_count());
    int i = SLICE;
    while (i < end) {
        Gathered part = nothing_gathered();
        int stop = min(end, i + SUM_BLOCK * SLICES);
        for (; i < stop; i += SLICES) {
            Vec3 position = photon_position_same(i);
            Vec3 away = sub3(position, query.surface.position);
            Real weight = kernel_shape(square3(away), inverse_radius2);
            Bool near_by = wanted && weight > 0.0f;
            if (!any_lane(near_by)) continue;
            int own = count_of(photon_face(i));
            near_by = near_by && face == own;
            if (any_lane(near_by)) part = add_photon(SCENE part, i, pick(near_by, weight, 0.0f), position, query);
        }
        sum = add_gathered(sum, part);
    }
    return sum;
}
#endif

// Photons of the lanes' faces by the method at hand.
Gathered gather_photons(SCENE_PARAMS Query query, Int face, Bool wanted, Int tile) {
#if defined(GATHER_BRUTE)
    return gather_all(SCENE query, face, wanted);
#elif defined(GATHER_TILES)
    Int region = find_region(SCENE tile, face, query.surface.position, wanted);
    Bool found = wanted && region >= 0;
    Gathered sum = gather_near(SCENE query, region, found);
    // Where another compiler's ray hits what the tile has not seen, an ulp beside an edge, the whole map is asked.
    Bool unseen = wanted && !found;
    if (any_lane(unseen)) {
        Gathered rest = gather_all(SCENE query, face, unseen);
        sum = add_gathered(sum, rest);
    }
    return sum;
#else
    return gather_near(SCENE query, face, wanted);
#endif
}

// Radiance that the photons around a visible point send towards the viewer, W·m⁻²·sr⁻¹.
Vec3 photon_radiance(SCENE_PARAMS Surface surface, Vec3 to_viewer, Bool wanted, Int tile) {
    Query query;
    query.surface = surface;
    query.to_viewer = to_viewer;
#ifdef HAS_GLOSSY
    Real specular = material_specular(MATERIAL_OF(surface.shape));
    // Surfaces without a lobe have α = 0: any other value keeps the unused lobe finite.
    query.alpha = pick(specular > 0.0f, material_roughness(MATERIAL_OF(surface.shape)), 1.0f);
#else
    query.alpha = lanes(1.0f);
#endif
    Int face = face_left(surface);
    Vec3 p = surface.position;
    // Beyond any photon, where squares would overflow.
    wanted = wanted && fabs(p.x) + fabs(p.y) + fabs(p.z) < 1e15f;
#ifdef GATHER_TILES
    wanted = wanted && scatters(SCENE surface.shape);
#endif
    Gathered sum = gather_photons(SCENE query, face, wanted, tile);
#ifdef GATHER_KNN
    Real inverse_radius = sum.inverse_radius;
#else
    Real inverse_radius = lanes(gather_inverse_radius());
#endif
    Real scale = KERNEL_PEAK * inverse_radius * inverse_radius;
#ifdef HAS_CLIP
    scale = scale / visible_part(SCENE surface, inverse_radius);
#endif
    Vec3 radiance = mul3(material_color(MATERIAL_OF(surface.shape)), scale3(sum.flux, material_diffuse(MATERIAL_OF(surface.shape)) * INV_PI));
#ifdef HAS_GLOSSY
    radiance = add3(radiance, scale3(sum.glint, specular));
#endif
    return scale3(radiance, scale);
}
#endif
