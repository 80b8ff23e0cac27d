// Fetches for lanes that rarely agree, as those of photon walks: included between shim.cl and the layout.
//
// A table of few records is read whole, each record kept by the lanes that want it: gathers are slow on CPUs (44
// cycles for 16 lanes, measured; with eight of them a step they were half of a walk in a room of eight objects).
#if LANES > 1
#define FEW_RECORDS 24

#define RECORDS_shapes SHAPE_COUNT
#ifdef SHARED_MATERIALS
#define RECORDS_materials (FEW_RECORDS + 1) // as many as there are: more than a few
#else
#define RECORDS_materials SHAPE_COUNT
#endif
#define RECORDS_charts RECORDS_shapes
#define RECORDS_texels (FEW_RECORDS + 1) // always more than a few
#define RECORDS_emitters count_of(frame_light_count())

INLINE Vec3 select3(__global const float *field, Int record, int stride, int records) {
    Vec3 v;
    if (records <= FEW_RECORDS) {
        v = NATIVE3(vload3(0, field));
        for (int i = 1; i < records; i++) {
            Bool wanted = record == i;
            __global const float *at = field + i * stride;
            v.x = pick(wanted, at[0], v.x);
            v.y = pick(wanted, at[1], v.y);
            v.z = pick(wanted, at[2], v.z);
        }
    } else {
        Int f = record * stride;
        v = make3(GATHER(Real, field, f), GATHER(Real, field + 1, f), GATHER(Real, field + 2, f));
    }
    return v;
}

INLINE Real select1(__global const float *field, Int record, int stride, int records) {
    Real v;
    if (records <= FEW_RECORDS) {
        v = lanes(field[0]);
        for (int i = 1; i < records; i++) v = pick(record == i, field[i * stride], v);
    } else {
        Int f = record * stride;
        v = GATHER(Real, field, f);
    }
    return v;
}

#undef FETCH3
#undef FETCH1
#define FETCH3(table, i, texels, t) select3(table + 3 * (t), i, 3 * (texels), RECORDS_##table)
#define FETCH1(table, i, texels, t, channel) select1(table + 3 * (t) + (channel), i, 3 * (texels), RECORDS_##table)
#endif
