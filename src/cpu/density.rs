//! Twin of `glsl/shared/kernel.glsl`: density kernels, and what planes leave of their integral.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use super::scene::{SceneTables, Surface};
use crate::gathering::{DensityKernel, Gathering};

/// K(0) for R = 1.
pub fn kernel_peak(kernel: DensityKernel) -> f32 {
    match kernel {
        DensityKernel::Constant => FRAC_1_PI,
        DensityKernel::Epanechnikov => 2.0 * FRAC_1_PI,
        DensityKernel::Cone | DensityKernel::Biweight => 3.0 * FRAC_1_PI,
    }
}

/// K/K(0) at squared distance `d2`, with 1/R²; zero outside.
pub fn kernel_shape(kernel: DensityKernel, d2: f32, inverse_radius2: f32) -> f32 {
    match kernel {
        DensityKernel::Constant => f32::from(u8::from(d2 * inverse_radius2 < 1.0)),
        DensityKernel::Epanechnikov => (1.0 - d2 * inverse_radius2).max(0.0),
        DensityKernel::Cone => (1.0 - (d2 * inverse_radius2).sqrt()).max(0.0),
        DensityKernel::Biweight => (1.0 - d2 * inverse_radius2).max(0.0).powi(2),
    }
}

/// 2π times the kernel's integral beyond a chord at distance `h`, between the chord's foot and its point at distance
/// `u` from there.
pub fn beyond_to(kernel: DensityKernel, h: f32, u: f32) -> f32 {
    let angle = u.atan2(h);
    let (h2, u2) = (h * h, u * u);
    match kernel {
        DensityKernel::Constant => angle - h * u,
        DensityKernel::Epanechnikov => angle - h * u * (2.0 - h2 - u2 * (1.0 / 3.0)),
        DensityKernel::Cone => {
            let r = (h2 + u2).sqrt();
            let rise = ((u.abs() + r) / h.max(1e-9)).ln().copysign(u);
            angle - 3.0 * h * u + h * u * r + h * h * h * rise
        }
        DensityKernel::Biweight => {
            angle - h * u * (3.0 - 3.0 * (h2 + u2 * (1.0 / 3.0)) + h2 * h2 + u2 * (2.0 / 3.0 * h2 + 0.2 * u2))
        }
    }
}

fn half_chord(h: f32) -> f32 {
    (1.0 - h * h).max(0.0).sqrt()
}

/// The kernel's integral beyond a chord at distance `h` in [0, 1).
pub fn beyond_chord(kernel: DensityKernel, h: f32) -> f32 {
    2.0 / TAU * beyond_to(kernel, h, half_chord(h))
}

/// The same beyond both of two chords whose directions enclose an angle of the given cosine.
pub fn beyond_both(kernel: DensityKernel, a: f32, b: f32, cosine: f32) -> f32 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let along_a = (b - a * cosine) / sine.max(1e-6);
    let along_b = (a - b * cosine) / sine.max(1e-6);
    if a * a + along_a * along_a < 1.0 {
        let beyond = |h: f32, along: f32| beyond_to(kernel, h, half_chord(h)) - beyond_to(kernel, h, along);
        return (beyond(a, along_a) + beyond(b, along_b)) / TAU;
    }
    let (near_chord, far_chord) = (a.min(b), a.max(b));
    let nested = far_chord * cosine - half_chord(far_chord) * sine >= near_chord;
    if nested { beyond_chord(kernel, far_chord) } else { 0.0 }
}

/// Where a plane cuts the disc around a query point: distance in radii, and the unit direction towards the chord.
#[derive(Clone, Copy, Debug)]
pub struct Chord {
    /// 1 or more (or NaN) when the plane does not cut the disc.
    pub distance: f32,
    /// Unit, in the tangent plane.
    pub towards: Vec3,
}

/// Object `i`, a plane, as seen from a point of another surface.
pub fn chord_of(scene: &SceneTables, i: usize, surface: &Surface, inverse_radius: f32) -> Chord {
    let normal = Vec3::from(scene.objects[i].anchor);
    let beyond = scene.objects[i].extent - normal.dot(surface.position);
    let cosine = normal.dot(surface.normal);
    let across = normal - surface.normal * cosine;
    let sine = across.dot(across).sqrt();
    let towards = across * (1f32.copysign(beyond) / sine.max(1e-6));
    let mut distance = beyond.abs() / sine * inverse_radius;
    if surface.object < scene.sphere_count {
        // Lambert's equal-area map: chordal distance to the circle that the plane cuts out of the sphere.
        let sphere = &scene.objects[surface.object];
        let outward = (surface.position - Vec3::from(sphere.anchor)) * (1.0 / sphere.extent);
        let point_cosine = normal.dot(outward);
        let circle_cosine = beyond / sphere.extent + point_cosine;
        let point_sine = (1.0 - point_cosine * point_cosine).max(0.0).sqrt();
        let circle_sine = (1.0 - circle_cosine * circle_cosine).max(0.0).sqrt();
        let (dc, ds) = (point_cosine - circle_cosine, point_sine - circle_sine);
        distance = (dc * dc + ds * ds).sqrt() * sphere.extent * inverse_radius;
        // A circle of less than R/20 takes 1/400 of the disc at most; a sphere that just touches the plane has one or
        // none by the last bit.
        let resembles_a_chord = circle_sine * sphere.extent * inverse_radius > 0.05;
        if !resembles_a_chord {
            distance = f32::INFINITY;
        }
    }
    if surface.object == i {
        distance = f32::INFINITY;
    }
    Chord { distance, towards }
}

/// The kernel's integral over the part of the disc on the query point's side of every plane.
pub fn visible_part(scene: &SceneTables, gathering: &Gathering, surface: &Surface, inverse_radius: f32) -> f32 {
    let kernel = gathering.kernel;
    let mut part = 1.0f32;
    for i in scene.sphere_count..scene.objects.len() {
        let chord = chord_of(scene, i, surface, inverse_radius);
        if chord.distance < 1.0 {
            part -= beyond_chord(kernel, chord.distance);
            for j in scene.sphere_count..i {
                let other = chord_of(scene, j, surface, inverse_radius);
                if other.distance < 1.0 {
                    part += beyond_both(kernel, chord.distance, other.distance, chord.towards.dot(other.towards));
                }
            }
        }
    }
    for i in (0..scene.sphere_count).filter(|_| gathering.footprints) {
        part -= footprint(scene, i, kernel, surface, inverse_radius);
    }
    part.max(1e-3)
}

/// 2π times the kernel's integral from distance `r` to the rim, along one direction.
pub fn beyond_radius(kernel: DensityKernel, r: f32) -> f32 {
    let r = r.clamp(0.0, 1.0);
    let w = 1.0 - r * r;
    match kernel {
        DensityKernel::Constant => w,
        DensityKernel::Epanechnikov => w * w,
        DensityKernel::Cone => w - 2.0 * r * r * (1.0 - r),
        DensityKernel::Biweight => w * w * w,
    }
}

/// The kernel's integral over what a circle of radius `rho` around a point at `distance` > `rho` covers of the disc.
pub fn covered_by_circle(kernel: DensityKernel, distance: f32, rho: f32) -> f32 {
    let mut sum = 0.0;
    for k in 0..8 {
        let (sine, cosine) = ((k as f32 + 0.5) * (TAU / 32.0)).sin_cos();
        let s = rho / distance * sine;
        let c = (1.0 - s * s).max(1e-12).sqrt();
        let (middle, half_length) = (distance * c, rho * cosine);
        sum += (beyond_radius(kernel, middle - half_length) - beyond_radius(kernel, middle + half_length))
            * (half_length / c);
    }
    sum / distance * (2.0 / 32.0)
}

/// What sphere `i`, where it cuts the plane that the point lies on, covers of the disc.
pub fn footprint(scene: &SceneTables, i: usize, kernel: DensityKernel, surface: &Surface, inverse_radius: f32) -> f32 {
    let sphere = &scene.objects[i];
    let away = Vec3::from(sphere.anchor) - surface.position;
    let height = away.dot(surface.normal);
    let across = away - surface.normal * height;
    let distance = across.dot(across).sqrt() * inverse_radius;
    let rho = (sphere.extent * sphere.extent - height * height).max(0.0).sqrt() * inverse_radius;
    if surface.object >= scene.sphere_count && rho > 0.0 && distance > rho && distance - rho < 1.0 {
        covered_by_circle(kernel, distance, rho)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Σ of the kernel over the unit disc's points that satisfy `keep`, by the midpoint rule on a square lattice.
    fn integrate(kernel: DensityKernel, steps: i32, keep: impl Fn(f64, f64) -> bool) -> f64 {
        let step = 2.0 / f64::from(steps);
        let mut sum = 0.0;
        for row in 0..steps {
            for column in 0..steps {
                let x = (f64::from(column) + 0.5) * step - 1.0;
                let y = (f64::from(row) + 0.5) * step - 1.0;
                if keep(x, y) {
                    sum += f64::from(kernel_shape(kernel, (x * x + y * y) as f32, 1.0));
                }
            }
        }
        sum * step * step * f64::from(kernel_peak(kernel))
    }

    // The lattice misjudges half a step along the rim and the chord: for the constant kernel, which does not fade
    // there, 2e-3 · length / π at 1000 steps, mostly cancelling.
    const LATTICE: f64 = 5e-4;

    #[test]
    fn each_kernel_integrates_to_one() {
        for kernel in DensityKernel::ALL {
            let whole = integrate(kernel, 1000, |_, _| true);
            assert!((whole - 1.0).abs() < LATTICE, "{kernel:?}: {whole}");
            // Both halves beyond a chord through the centre: the closed form's own limit.
            assert!((beyond_chord(kernel, 0.0) - 0.5).abs() < 1e-6, "{kernel:?}");
            assert!(beyond_chord(kernel, 1.0).abs() < 1e-6, "{kernel:?}");
        }
        assert!((integrate(DensityKernel::Cone, 1000, |x, _| x < 0.9) - 1.0).abs() > LATTICE, "a lost rim must show");
    }

    #[test]
    fn one_chord_has_a_closed_form() {
        for kernel in DensityKernel::ALL {
            for h in [0.01, 0.2, 0.5, 0.77, 0.95] {
                let (closed, numeric) =
                    (f64::from(beyond_chord(kernel, h as f32)), integrate(kernel, 1000, |x, _| x > h));
                assert!((closed - numeric).abs() < LATTICE, "{kernel:?} at {h}: {closed} against {numeric}");
            }
        }
    }

    #[test]
    fn two_chords_are_exact_at_any_angle() {
        for kernel in DensityKernel::ALL {
            for degrees in [1.0f64, 10.0, 45.0, 90.0, 120.0, 170.0, 180.0] {
                let (sine, cosine) = degrees.to_radians().sin_cos();
                for (a, b) in [(0.1, 0.2), (0.5, 0.05), (0.7, 0.7), (0.3, 0.9), (0.0, 0.4), (0.6, 0.6)] {
                    let closed = f64::from(beyond_both(kernel, a as f32, b as f32, cosine as f32));
                    let numeric = integrate(kernel, 500, |x, y| x > a && x * cosine + y * sine > b);
                    // Twice as coarse a lattice, two edges.
                    let close = (closed - numeric).abs() < 4.0 * LATTICE;
                    assert!(close, "{kernel:?}, {a} and {b} at {degrees}°: {closed} against {numeric}");
                }
            }
        }
    }

    #[test]
    fn circles_are_integrated_well() {
        for kernel in DensityKernel::ALL {
            for (distance, rho) in [(0.5, 0.3), (0.5, 0.49), (1.0, 0.4), (1.2, 0.9), (5.0, 4.5), (20.0, 19.9)] {
                let found = f64::from(covered_by_circle(kernel, distance as f32, rho as f32));
                let numeric = integrate(kernel, 500, |x, y| (x - distance).powi(2) + y * y < rho * rho);
                // Eight directions: half a percent of the disc at worst, where a large circle nearly touches the
                // point or the constant kernel's rim kinks the integrand; a footprint covers up to half.
                assert!((found - numeric).abs() < 0.02, "{kernel:?}, {rho} at {distance}: {found} against {numeric}");
            }
        }
    }

    #[test]
    fn the_product_of_two_chords_would_be_seen_to_be_wrong() {
        let kernel = DensityKernel::Epanechnikov;
        let (a, b) = (0.2f32, 0.3f32);
        let product = f64::from((1.0 - beyond_chord(kernel, a)) * (1.0 - beyond_chord(kernel, b)));
        let exact = f64::from(1.0 - beyond_chord(kernel, a) - beyond_chord(kernel, b) + beyond_both(kernel, a, b, 0.0));
        let numeric = integrate(kernel, 1000, |x, y| x < f64::from(a) && y < f64::from(b));
        assert!((exact - numeric).abs() < LATTICE);
        assert!((product - numeric).abs() > 4.0 * LATTICE, "the product is {product}, the truth {numeric}");
    }
}
