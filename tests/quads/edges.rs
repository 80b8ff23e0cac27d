//! Density estimates beside a quad's edges and corners: as bright as the same light is in its middle.

use std::f64::consts::PI;

use glam::DVec3;
use photile::settings::{GridForm, LightMode, Method};

use super::{gathered, quad};
use crate::common::{Pinhole, backends, pixels, render, scene};

/// Half a side, or height, of the quad; metres.
const HALF: f64 = 1.0;
/// Of the lamp above its middle.
const HEIGHT: f64 = 6.0;
/// Of discs.
const RADIUS: f64 = 0.15;

#[test]
fn a_quads_edges_and_corners_are_as_bright_as_its_middle() {
    // A square, and a rhombus with corners of 60 and 120 degrees.
    for lean in [0.0, 0.5] {
        let edges = [DVec3::new(2.0, 0.0, 0.0), DVec3::new(2.0 * lean, 0.0, -2.0)];
        let corner = -(edges[0] + edges[1]) / 2.0;
        let text = quad(&format!("{:?}", corner.to_array()), &format!("{:?}", edges.map(|e| e.to_array())), "m");
        let scene = scene(&format!(
            "[camera]\nposition = [0, 4, 0]\nlook_at = [0, 0, 0]\nup = [0, 0, -1]\nfov_y = 30\n[materials.m]\n\
             color = [0.5, 0.5, 0.5]\n[[lights]]\nposition = [0, {HEIGHT}, 0]\nintensity = [100, 100, 100]\n{text}"
        ));
        for method in [Method::Grid, Method::Tiles] {
            let settings = gathered((96, 96), LightMode::Photons, (method, GridForm::Auto), 300_000, RADIUS as f32);
            let camera = Pinhole::new(&scene.camera, &settings);
            for mut pipeline in backends() {
                let image = render(&mut pipeline, &scene, &settings);
                // Brightness as a share of the formula's: sum and number, in the middle, at edges, in corners.
                let mut zones = [(0.0, 0); 3];
                for (x, y) in pixels(&image) {
                    let direction = camera.through(x, y);
                    let point = camera.position + direction * (-camera.position.y / direction.y);
                    let away = [(point.x + point.z * lean).abs(), point.z.abs()].map(|at| HALF - at);
                    // Metres to each edge.
                    let away = [away[0] / (1.0 + lean * lean).sqrt(), away[1]];
                    if away.iter().any(|away| *away < 1e-4) {
                        continue;
                    }
                    let r2 = point.length_squared() + HEIGHT * HEIGHT;
                    let expected = 0.5 / PI * 100.0 * HEIGHT / r2.powf(1.5);
                    let near = away.iter().filter(|away| **away < 0.4 * RADIUS).count();
                    if near == 0 && away.iter().any(|away| *away < RADIUS) {
                        continue;
                    }
                    zones[near].0 += f64::from(image.at(x, y)[1]) / expected;
                    zones[near].1 += 1;
                }
                let shares = zones.map(|(sum, number)| sum / f64::from(number));
                eprintln!("{}, {method:?}, lean {lean}: {shares:?} of {zones:?}", pipeline.backend.name());
                // 1%: of the whole quad's photons noise is a third of that, and the light's slope across half a disc,
                // which a cut disc leans to, 0.3%. In corners, each of a few hundred photons, 3%. Uncut, edges would
                // have six tenths of the light and corners a third.
                for (share, bound) in shares.into_iter().zip([0.01, 0.01, 0.03]) {
                    let name = pipeline.backend.name();
                    assert!((share - 1.0).abs() < bound, "{name}, {method:?}, lean {lean}: {shares:?}");
                }
                assert!(zones.iter().all(|(_, number)| *number >= 8), "{zones:?}");
            }
        }
    }
}
