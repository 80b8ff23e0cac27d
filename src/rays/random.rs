//! Twin of `glsl/shared/random.glsl`: counter-based random numbers, the same integers on every backend.

/// PCG output permutation used as a hash (Jarzynski & Olano, JCGT 2020).
pub fn hash_u(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Chain of hashes over two counters.
pub fn hash2_u(a: u32, b: u32) -> u32 {
    hash_u(a ^ hash_u(b))
}

/// The 24 high bits as a real in [0, 1).
pub fn unit_real(u: u32) -> f32 {
    // 2⁻²⁴: exact, and never 1
    (u >> 8) as f32 * 5.960_464_5e-8
}

/// Owen scrambling of a bit-reversed value (Laine & Karras 2011; constants of Vegdahl 2021).
pub fn scramble_reversed(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// Owen scrambling: a random permutation in every node of the binary tree over [0, 1).
pub fn owen_scramble(x: u32, seed: u32) -> u32 {
    scramble_reversed(x.reverse_bits(), seed).reverse_bits()
}

/// Second dimension of Sobol's (0,2)-sequence; the first is the index with its bits reversed.
pub fn sobol_second(index: u32) -> u32 {
    let mut v = 0x8000_0000u32;
    let mut sum = 0;
    for bit in 0..32 {
        if index >> bit & 1 == 1 {
            sum ^= v;
        }
        v ^= v >> 1;
    }
    sum
}

/// Steps of Roberts' R₂ sequence in 32-bit fixed point.
pub const R2_STEPS: [u32; 2] = [3_242_174_889, 2_447_445_414];

/// Steps of Roberts' R₄ sequence, φ₄⁻¹ … φ₄⁻⁴ in 32-bit fixed point.
pub const R4_STEPS: [u32; 4] = [3_679_390_609, 3_152_041_523, 2_700_274_805, 2_313_257_605];

/// Point `index` of one dimension of a Kronecker sequence, shifted (Cranley & Patterson 1976).
pub fn sequence_u(index: u32, step: u32, shift: u32) -> u32 {
    index.wrapping_mul(step).wrapping_add(shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scrambled_points_stay_a_0_2_sequence() {
        // Every elementary interval of area 1/64 holds exactly one of the first 64 points, whatever the seed.
        for seed in [0, 1, 0xdead_beef] {
            let points: Vec<_> = (0..64u32)
                .map(|i| (owen_scramble(i.reverse_bits(), seed), owen_scramble(sobol_second(i), hash_u(seed))))
                .collect();
            for across in 0..=6 {
                let mut seen = std::collections::HashSet::new();
                for (x, y) in &points {
                    let cell = (u64::from(*x) >> (32 - across), u64::from(*y) >> (32 - (6 - across)));
                    assert!(seen.insert(cell), "seed {seed}: two points in one {across}-interval");
                }
            }
        }
    }

    #[test]
    fn unit_reals_never_reach_one() {
        assert!(unit_real(u32::MAX) < 1.0);
        assert_eq!(unit_real(0), 0.0);
    }
}
