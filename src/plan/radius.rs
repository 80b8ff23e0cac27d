//! The gather radius, chosen from the scene and the number of photons where the user names none.

use glam::Vec3;

use crate::plan::photon_sample::Sample;
use crate::rays::camera::camera_direction;
use crate::rays::scene::SceneTables;
use crate::records::Frame;
use crate::shapes::sheet_of;

/// Photons that are looked at.
pub const SAMPLE: usize = 1 << 14;

/// R = `SCALE` · √A · n^(−1/6): see [`choose`]. Measured: the best radii of the report's rooms at 20k and 200k paths
/// lie between 0.23 and 0.33; the error's minimum is flat there.
const SCALE: f64 = 0.26;

/// Largest R in radii of a sphere that is plainly seen: around a sphere, light varies over its own size. Measured on
/// sphere_and_plane, whose best radius is 0.9 at 7,272 photons (200k paths) and 1.26 at a tenth of them.
const OF_SPHERE: f64 = 0.9;

/// Photons below which noise is worse than that: the limit then goes with n^(−1/6) as R itself does.
const FEW: f64 = 7000.0;

/// Points of the raster that see a sphere for it to count: 2% of the picture.
const PLAINLY: usize = 4;

/// A radius near the best RMSE for `stored` photons, metres.
///
/// The variance of a density estimate falls with n·R²/A, its squared bias rises with R⁴, so the best R goes with
/// n^(−1/6) (Silverman 1986, ch. 4.3 in two dimensions). √A, the length over which light varies, is that of the surface
/// over which the photons would be spread if they lay everywhere as densely as in the median visible point.
pub fn choose(scene: &SceneTables, frame: &Frame, sample: &Sample, stored: u64) -> f32 {
    let points = visible_points(scene, frame);
    let mut faces = vec![Vec::new(); 2 * scene.shapes.len()];
    for (position, face) in sample.positions.iter().zip(&sample.faces) {
        faces[*face as usize].push(Vec3::from(position.position));
    }
    let area =
        |&(p, (shape, side)): &(Vec3, (usize, f32))| area_of_a_photon(&faces[2 * shape + usize::from(side < 0.0)], p);
    let mut areas: Vec<f64> = points.iter().filter_map(area).collect();
    if areas.is_empty() {
        // Nothing is seen where photons lie: any radius gives the same black picture.
        return 1.0;
    }
    areas.sort_by(f64::total_cmp);
    let spread = areas[areas.len() / 2] * sample.positions.len() as f64;
    let radius = (SCALE * spread.sqrt() * (stored as f64).powf(-1.0 / 6.0)) as f32;
    let limit = (OF_SPHERE * (FEW / stored.max(1) as f64).powf(1.0 / 6.0).max(1.0)) as f32;
    let seen = |shape: usize| points.iter().filter(|(_, (number, _))| *number == shape).count() >= PLAINLY;
    let curved = scene.shapes.iter().map(|shape| sheet_of(shape).curvature_radius() as f32).enumerate();
    let seen = curved.filter(|(number, curvature)| curvature.is_finite() && seen(*number));
    seen.map(|(_, curvature)| curvature * limit).fold(radius, f32::min)
}

/// Columns and rows of the coarse raster of pixels that is looked at.
const COLUMNS: usize = 16;
const ROWS: usize = 12;
/// Pixels of the raster.
pub(crate) const RASTER: usize = COLUMNS * ROWS;

/// What a coarse raster of pixels sees: points, with object and side.
pub(crate) fn visible_points(scene: &SceneTables, frame: &Frame) -> Vec<(Vec3, (usize, f32))> {
    let raster = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (column, row)));
    let see = |(column, row)| {
        let x = (column as f32 + 0.5) / COLUMNS as f32 * frame.width;
        let y = (row as f32 + 0.5) / ROWS as f32 * frame.height;
        let (origin, direction) = (frame.position.into(), camera_direction(frame, x, y));
        let hit = scene.closest_hit(origin, direction, None)?;
        let surface = scene.surface_at(origin, direction, hit);
        Some((surface.position, (surface.shape, surface.side)))
    };
    raster.filter_map(see).collect()
}

/// Area per photon around a point, from the disc that the nearest ones of its face's photons span, m².
fn area_of_a_photon(photons: &[Vec3], point: Vec3) -> Option<f64> {
    const NEAREST: usize = 24; // the area is known to ±20%, R to ±10%
    if photons.len() <= NEAREST {
        return None;
    }
    // The nearest so far, the farthest of them last. Photons come in no order, so few are ever among them.
    let mut nearest = [f32::INFINITY; NEAREST + 1];
    for photon in photons {
        let d2 = photon.distance_squared(point);
        if d2 < nearest[NEAREST] {
            let place = nearest.partition_point(|nearer| *nearer <= d2);
            nearest.copy_within(place..NEAREST, place + 1);
            nearest[place] = d2;
        }
    }
    Some(std::f64::consts::PI * f64::from(nearest[NEAREST]) / NEAREST as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disc_reaches_to_the_25th_photon() {
        // On a ring each, out of order.
        let photons: Vec<Vec3> = (0..100).map(|i| Vec3::X * ((i * 37 % 100) as f32 + 1.0)).collect();
        let area = area_of_a_photon(&photons, Vec3::ZERO).expect("enough of them");
        assert!((area - std::f64::consts::PI * 625.0 / 24.0).abs() < 1e-9, "{area}");
        assert!(area_of_a_photon(&photons[..24], Vec3::ZERO).is_none());
    }
}
