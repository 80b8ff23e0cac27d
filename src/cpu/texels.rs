//! Twin of `glsl/shared/texels.glsl` and `kernels/irradiance.cl`: irradiance texels, and photons added to them.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::photons::{stream_of, walk_photons};
use crate::plan::charts::{Charts, Neighbourhood};
use crate::rays::emission::{Emission, EmissionPlan, Quanta};
use crate::rays::random::unit_real;
use crate::rays::scene::{SceneTables, Surface};
use crate::rays::shapes;
use crate::rays::walk::number_u;
use crate::records::face::sheet_of_shape;
use crate::records::{Chart, Texel};

/// The texel of a surface point.
pub fn texel_of(scene: &SceneTables, charts: &[Chart], surface: &Surface) -> usize {
    let chart = &charts[sheet_of_shape(surface.shape)];
    let shape = &scene.at(surface.shape);
    let (u, v) = shapes::chart_point(shape, chart, surface.position, surface.normal * surface.side);
    let column = ((u * 0.5 + 0.5) * chart.columns).max(0.0).min(chart.columns - 1.0) as usize;
    let row = ((v * 0.5 + 0.5) * chart.rows).max(0.0).min(chart.rows - 1.0) as usize;
    let (columns, rows) = (chart.columns as usize, chart.rows as usize);
    let back = if surface.side < 0.0 { columns * rows } else { 0 };
    chart.first as usize + back + row * columns + column
}

/// Walks a pass's paths and adds what they bring to the texels, on the calling thread's rayon pool.
pub fn irradiance(
    scene: &SceneTables,
    plan: &EmissionPlan,
    charts: &Charts,
    emission: &Emission,
    paths: u32,
) -> Vec<Texel> {
    let emitters = plan.emitters(paths);
    let quanta = Quanta::of(&emitters, paths);
    let stream = stream_of(emission.seed, emission.pass);
    let sums: Vec<AtomicU32> = (0..3 * charts.texels()).map(|_| AtomicU32::new(0)).collect();
    let paths = if plan.is_empty() { 0 } else { paths };
    (0..paths).into_par_iter().with_min_len(1024).for_each(|path| {
        walk_photons(scene, plan, &emitters, emission, path, stream, |photon, surface| {
            let texel = texel_of(scene, &charts.records, surface);
            let chance = unit_real(number_u(photon.key, 8));
            let brought = photon.throughput * (photon.power * quanta.per_watt);
            for channel in 0..3 {
                // Whole numbers: the sum does not depend on the order of threads.
                sums[3 * texel + channel].fetch_add((brought[channel] + chance) as u32, Ordering::Relaxed);
            }
        });
    });
    let watts = quanta.watts;
    let sums: Vec<u32> = sums.into_iter().map(AtomicU32::into_inner).collect();
    let texel = |(i, (inverse_area, neighbourhood)): (usize, (&f32, &Neighbourhood))| {
        let mut quanta = [0u32; 3];
        if *inverse_area > 0.0 {
            for texel in neighbourhood.texels(i).map(|i| &sums[3 * i..3 * i + 3]) {
                (0..3).for_each(|channel| quanta[channel] += texel[channel]);
            }
        }
        Texel { irradiance: quanta.map(|quanta| quanta as f32 * (inverse_area * watts)) }
    };
    charts.inverse_areas.par_iter().zip(&charts.neighbourhoods).enumerate().map(texel).collect()
}
