// Irradiance texels: photons are walked as in photons.cl, but what they bring is added to the texel that they hit.
// Power is counted in whole quanta, so that the sum does not depend on the order in which atomics come.
#define HAS_CHARTS
#include "paths.cl"
#include "shared/texels.glsl"

// Quanta of a lane's photon, rounded at random so that the mean is right.
INLINE void add_quanta(__global uint *sums, Bool stored, Int texel, Vec3 quanta, Uint key) {
    Real chance = unit_real(number_u(key, 8u));
#if LANES == 1
    if (!stored) return;
    atomic_add(&sums[3 * texel], (uint)(quanta.x + chance));
    atomic_add(&sums[3 * texel + 1], (uint)(quanta.y + chance));
    atomic_add(&sums[3 * texel + 2], (uint)(quanta.z + chance));
#else
    int places[LANES], masks[LANES], x[LANES], y[LANES], z[LANES];
    CONCAT(vstore, LANES)(texel * 3, 0, places);
    CONCAT(vstore, LANES)(stored, 0, masks);
    CONCAT(vstore, LANES)(to_int(quanta.x + chance), 0, x);
    CONCAT(vstore, LANES)(to_int(quanta.y + chance), 0, y);
    CONCAT(vstore, LANES)(to_int(quanta.z + chance), 0, z);
    for (int lane = 0; lane < LANES; lane++) {
        if (!masks[lane]) continue;
        __global uint *sum = sums + places[lane];
        atomic_add(sum, x[lane]);
        atomic_add(sum + 1, y[lane]);
        atomic_add(sum + 2, z[lane]);
    }
#endif
}

// sums: quanta, three a texel.
__kernel void irradiance_splat(WALK_PARAMS uint runs, float quanta_per_watt, __global uint *sums) {
    if (FIRST_RUN >= runs) return;
    Uint run = lanes_u(FIRST_RUN) + LANE_NUMBER;
    Uint path = run_start(run, first_path, end_path, run_length);
    Uint end = run_start(run + 1u, first_path, end_path, run_length);
    Photon photon = no_photon();
    Bool alive = NO_LANE;
    while (any_lane(path < end)) {
        if (any_lane(!alive)) photon = pick_photon(alive, photon, emit_photon(SCENE EMISSION path, stream));
        Step step = walk(SCENE photon);
        Bool stored = step.stored && path < end;
        if (any_lane(stored)) {
            Vec3 quanta = scale3(photon.throughput, photon.power * quanta_per_watt);
            add_quanta(sums, stored, texel_of(SCENE step.surface), quanta, photon.key);
        }
        photon = step.photon;
        alive = step.survives;
        path += pick_u(alive, 0u, 1u);
    }
}

// inverse_areas: of neighbourhoods, 1/m², 0 for texels that nothing reaches; neighbourhoods: columns of the chart << 8 |
// half-width, texels (neighbourhood.rs); texels: packed triples. All quanta together fit into 32 bits.
__kernel void irradiance_resolve(__global const uint *sums, __global const float *inverse_areas,
                                 __global const uint *neighbourhoods, float watts_per_quantum, __global float *texels, uint count) {
    uint texel = (uint)get_global_id(0);
    if (texel >= count) return;
    uint3 quanta = (uint3)(0u);
    float inverse_area = inverse_areas[texel];
    if (inverse_area > 0.0f) {
        uint half_width = neighbourhoods[texel] & 255u, stride = neighbourhoods[texel] >> 8u;
        uint first = texel - half_width * stride - half_width;
        for (uint row = 0u; row <= 2u * half_width; row++)
            for (uint column = 0u; column <= 2u * half_width; column++)
                quanta += vload3(first + row * stride + column, sums);
    }
    vstore3(convert_float3(quanta) * (inverse_area * watts_per_quantum), texel, texels);
}

__kernel void irradiance_clear(__global uint *sums, uint count) {
    uint i = (uint)get_global_id(0);
    if (i < count) sums[i] = 0u;
}
