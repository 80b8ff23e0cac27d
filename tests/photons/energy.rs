//! Energy and uniformity, against closed forms.

use std::f64::consts::PI;

use photile::rays::emission::{Emission, Sampler};
use photile::rays::walk::{sample_cosine, sample_ggx, smith_g1, unit_circle};

use super::{Case, grey_box, paths, power_by_bounce};

#[test]
fn a_closed_box_follows_the_albedo_series() {
    let number = 100_000;
    for albedo in [0.3, 0.7] {
        let power = power_by_bounce(&grey_box(albedo).twin(&paths(number)));
        for bounce in 0..8 {
            // Bounce k deposits Φ·ρᵏ, carried by N·ρᵏ photons of equal power: binomial, five standard deviations.
            let share = albedo.powi(bounce);
            let deviation = 5.0 * (share * (1.0 - share) / f64::from(number)).sqrt();
            let measured = power[bounce as usize] / (3.0 * 4.0 * PI);
            // 1e-6: float32 powers
            assert!(
                (measured - share).abs() <= deviation + 1e-6,
                "ρ {albedo}, bounce {bounce}: {measured} for {share}"
            );
            assert!(bounce > 2 || (measured * 1.1 - share).abs() > deviation, "10% too much must show");
        }
    }
}

#[test]
fn white_walls_end_and_lose_nothing() {
    let power = power_by_bounce(&grey_box(1.0).twin(&paths(20_000)));
    for (bounce, power) in power.iter().enumerate().take(17) {
        assert!((power / (12.0 * PI) - 1.0).abs() < 1e-5, "bounce {bounce}: {power}");
    }
    // Survivors of 20 rounds of roulette at 0.95 carry 1/0.95²⁰ each: relative variance (1/0.95²⁰ − 1)/N.
    let deviation = 5.0 * ((0.95f64.powi(-20) - 1.0) / 20_000.0).sqrt();
    assert!((power[36] / (12.0 * PI) - 1.0).abs() < deviation, "{}", power[36] / (12.0 * PI));
}

#[test]
fn each_light_brings_its_own_flux() {
    // Two boxes in one scene, with a light each; their colours tell the lights' photons apart.
    let case = Case::parse(
        "[materials.black]\ncolor = [0, 0, 0]\n\
         [[lights]]\nposition = [0, 0, 0]\nintensity = [1, 0, 0]\n\
         [[lights]]\nposition = [10, 0, 0]\nintensity = [0, 0.001, 7]\n\
         [[lights]]\nposition = [20, 0, 0]\nintensity = [0, 0, 0]\n\
         [[spheres]]\ncenter = [0, 0, 0]\nradius = 2\nmaterial = \"black\"\n\
         [[spheres]]\ncenter = [10, 0, 0]\nradius = 3\nmaterial = \"black\"\n",
    );
    for number in [2, 3, 17, 4096, 10_007] {
        let map = case.twin(&paths(number));
        let mut flux = [0.0f64; 3];
        for power in &map.powers {
            (0..3).for_each(|c| flux[c] += f64::from(power.power[c]));
        }
        let own = case.plan.paths_of_lights(number);
        assert_eq!(own.iter().sum::<u64>(), u64::from(number));
        assert_eq!(own[2], 0, "a dark light gets no path");
        if own[0] > 0 && own[1] > 0 {
            for (channel, intensity) in [1.0, 0.001, 7.0].into_iter().enumerate() {
                let expected = 4.0 * PI * intensity;
                assert!((flux[channel] / expected - 1.0).abs() < 1e-5, "{number} paths, channel {channel}: {flux:?}");
            }
        }
    }
}

#[test]
fn a_sphere_lit_from_its_centre_is_lit_evenly() {
    let case = Case::parse(
        "[materials.grey]\ncolor = [0.5, 0.5, 0.5]\n[[lights]]\nposition = [1, 2, 3]\nintensity = [1, 1, 1]\n\
         [[spheres]]\ncenter = [1, 2, 3]\nradius = 2\nmaterial = \"grey\"\n",
    );
    let map = case.twin(&paths(100_000));
    // E = Φ/(4πR²)/(1−ρ) = 4π/(16π)/0.5 = 0.5 W/m² on each of 12 × 12 patches of equal area.
    let mut irradiance = [[0.0f64; 12]; 12];
    for (photon, power) in map.positions.iter().zip(&map.powers) {
        let p: Vec<f64> = photon.position.iter().zip([1.0, 2.0, 3.0]).map(|(p, c)| (f64::from(*p) - c) / 2.0).collect();
        assert!((p.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-6, "off the sphere");
        let row = ((p[1] * 0.5 + 0.5) * 12.0).clamp(0.0, 11.0) as usize;
        let column = ((p[2].atan2(p[0]) / (2.0 * PI) + 0.5) * 12.0).clamp(0.0, 11.0) as usize;
        irradiance[row][column] += f64::from(power.power[0]) / (16.0 * PI / 144.0);
    }
    // 200,000 photons on 144 patches: 2.7% standard deviation if all were random; a light 0.2 off centre shows as 20%.
    for e in irradiance.iter().flatten() {
        assert!((e / 0.5 - 1.0).abs() < 0.11, "{e}");
    }
}

/// χ² of the first hits' directions from the centre of a sphere over 16 × 32 patches of equal area.
fn chi2(emission: &Emission, number: u32) -> f64 {
    let case = Case::parse(
        "[materials.black]\ncolor = [0, 0, 0]\n[[lights]]\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n\
         [[spheres]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"black\"\n",
    );
    let mut counts = [0u32; 512];
    for photon in &case.twin(emission).positions {
        let [x, y, z] = photon.position.map(f64::from);
        let row = ((y * 0.5 + 0.5) * 16.0).clamp(0.0, 15.0) as usize;
        let column = ((z.atan2(x) / (2.0 * PI) + 0.5) * 32.0).clamp(0.0, 31.0) as usize;
        counts[row * 32 + column] += 1;
    }
    let expected = f64::from(number) / 512.0;
    counts.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum()
}

#[test]
fn emission_is_uniform() {
    let number = 50_000;
    let random = chi2(&Emission { sampler: Sampler::Random, ..paths(number) }, number);
    // 511 degrees of freedom: mean 511, standard deviation 32.
    assert!((511.0 - 160.0..511.0 + 160.0).contains(&random), "random: {random}");
    let sequence = chi2(&paths(number), number);
    assert!(sequence < 100.0, "a sequence is far more even than chance: {sequence}");
}

#[test]
fn seeds_and_passes_emit_different_paths() {
    let case = grey_box(0.5);
    let [a, b, c] = [(1, 0), (2, 0), (1, 1)].map(|(seed, pass)| case.twin(&Emission { seed, pass, ..paths(100) }));
    assert!(a.positions != b.positions && a.positions != c.positions && b.positions != c.positions);
}

#[test]
fn the_circle_is_round() {
    for i in 0..4096u32 {
        let turn = i.wrapping_mul(1_048_583);
        let angle = (f64::from(turn) / 2f64.powi(32) - 0.125) * 2.0 * PI;
        let (x, y) = unit_circle(turn);
        // 2⁻²³ of rounding; the 24 bits kept of a quadrant are finer.
        assert!((f64::from(x) - angle.cos()).abs() < 2.5e-7 && (f64::from(y) - angle.sin()).abs() < 2.5e-7, "{turn}");
    }
}

#[test]
fn cosine_directions_have_their_moments() {
    let normal = glam::Vec3::new(0.6, -0.48, 0.64);
    let number = 1u32 << 16;
    let cosines =
        |i: u32| f64::from(sample_cosine(normal, i.reverse_bits(), i.wrapping_mul(2_654_435_769)).dot(normal));
    let mean = (0..number).map(cosines).sum::<f64>() / f64::from(number);
    // E[cosθ] = 2/3 for density cosθ/π; uniform directions would give 1/2.
    assert!((mean - 2.0 / 3.0).abs() < 1e-4, "{mean}");
    assert!((0..number).all(|i| cosines(i) > -1e-6));
}

#[test]
fn the_lobe_reflects_its_directional_albedo() {
    // ∫ D·G/(4 cosθi cosθo) cosθi dωi by quadrature over directions, against the mean weight of sampled ones.
    let normal = glam::Vec3::Z;
    for alpha in [1.0f32, 0.5, 0.2] {
        for cos_o in [0.95f32, 0.5, 0.2] {
            let viewer = glam::Vec3::new((1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o);
            let number = 1u32 << 15;
            let sampled = (0..number)
                .map(|i| {
                    let half_way = sample_ggx(normal, viewer, alpha, i.reverse_bits(), i.wrapping_mul(2_654_435_769));
                    let light = half_way * (2.0 * half_way.dot(viewer)) - viewer;
                    if light.z > 0.0 { f64::from(smith_g1(light.z, alpha)) } else { 0.0 }
                })
                .sum::<f64>()
                / f64::from(number);
            let (rows, columns) = (400, 800);
            let mut integral = 0.0;
            for row in 0..rows {
                for column in 0..columns {
                    let cos_i = (f64::from(row) + 0.5) / f64::from(rows);
                    let turn = (f64::from(column) + 0.5) / f64::from(columns) * 2.0 * PI;
                    let sin_i = (1.0 - cos_i * cos_i).sqrt();
                    let light = glam::DVec3::new(sin_i * turn.cos(), sin_i * turn.sin(), cos_i).as_vec3();
                    let value = photile::rays::bsdf::ggx(normal, viewer, light, cos_o, light.z, alpha);
                    integral += f64::from(value) * cos_i * 2.0 * PI / f64::from(rows * columns);
                }
            }
            // 2e-3: the sequence's error at 2¹⁵ samples
            assert!((sampled - integral).abs() < 2e-3, "α {alpha}, cosθ {cos_o}: {sampled} for {integral}");
        }
    }
}
