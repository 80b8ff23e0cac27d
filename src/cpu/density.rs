//! Twin of `glsl/shared/kernel.glsl`: density kernels, and what planes leave of their integral.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use crate::program::gathering::{DensityKernel, Gathering};
use crate::rays::scene::{SceneTables, Surface};
use crate::rays::shapes::{self, Cut, SurfaceOf};

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

/// 1/h of what [`beyond_chord`]'s powers of the secant integrate to, at distance `u` from the chord's foot; odd in `u`.
fn secants_to(kernel: DensityKernel, h: f32, u: f32) -> f32 {
    let (h2, u2) = (h * h, u * u);
    match kernel {
        DensityKernel::Constant => u,
        DensityKernel::Epanechnikov => u * (2.0 - h2 - u2 * (1.0 / 3.0)),
        DensityKernel::Cone => {
            let r = (h2 + u2).sqrt();
            let rise = ((u.abs() + r) / h.max(1e-9)).ln().copysign(u);
            u * (3.0 - r) - h2 * rise
        }
        DensityKernel::Biweight => {
            u * (3.0 - 3.0 * (h2 + u2 * (1.0 / 3.0)) + h2 * h2 + u2 * (2.0 / 3.0 * h2 + 0.2 * u2))
        }
    }
}

/// 2π times the kernel's integral beyond a chord at distance `h`, over the sector in which the centre sees the chord's
/// points from `low` to `high`, distances from its foot.
pub fn beyond_chord(kernel: DensityKernel, h: f32, low: f32, high: f32) -> f32 {
    let angle = (h * (high - low)).atan2(h * h + low * high);
    angle - h * (secants_to(kernel, h, high) - secants_to(kernel, h, low))
}

/// 2π times the kernel's integral over the part of the disc that cut `i` hides: `cuts` are all that cross the disc, and
/// `normal` is the tangent plane's.
pub fn lost_beyond(kernel: DensityKernel, cuts: &[Cut], i: usize, normal: Vec3) -> f32 {
    let cut = &cuts[i];
    let h = cut.beyond / cut.sine;
    let towards = cut.across / cut.sine;
    let along = normal.cross(towards);
    // The chord's piece on the query point's side of all others.
    let mut high = (1.0 - h * h).max(0.0).sqrt();
    let mut low = -high;
    for (j, other) in cuts.iter().enumerate().filter(|(j, _)| *j != i) {
        let mut room = other.beyond - h * other.across.dot(towards);
        let slope = other.across.dot(along);
        // Of lines that lie in one another, by all that rounding leaves of them, the first counts.
        if slope * slope < 1e-10 * other.sine * other.sine {
            room += other.sine * if j < i { -1e-4 } else { 1e-4 };
        }
        let slope = slope.abs().max(1e-20).copysign(slope);
        let crossing = room / slope;
        if slope > 0.0 {
            high = high.min(crossing);
        } else {
            low = low.max(crossing);
        }
    }
    if low < high { beyond_chord(kernel, h, low, high) } else { 0.0 }
}

/// The kernel's integral over the part of the disc on the query point's side of every plane.
pub fn visible_part(scene: &SceneTables, gathering: &Gathering, surface: &Surface, inverse_radius: f32) -> f32 {
    let kernel = gathering.density_kernel;
    let on = SurfaceOf {
        shape: &scene.shapes[surface.shape],
        is_own: false,
        position: surface.position,
        normal: surface.normal,
    };
    let cuts = scene.all().flat_map(|shape| {
        let on = SurfaceOf { is_own: shape.number == surface.shape, ..on };
        (0..shapes::cuts(&shape)).map(move |cut| shapes::cut(&shape, cut, &on, inverse_radius))
    });
    let cuts: Vec<Cut> = cuts.filter(|cut| cut.beyond < cut.sine).collect();
    let lost: f32 = (0..cuts.len()).map(|i| lost_beyond(kernel, &cuts, i, surface.normal)).sum();
    let mut part = 1.0 - lost / TAU;
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
    let sphere = &scene.shapes[i];
    let away = Vec3::from(sphere.anchor) - surface.position;
    let height = away.dot(surface.normal);
    let across = away - surface.normal * height;
    let distance = across.dot(across).sqrt() * inverse_radius;
    let rho = (sphere.extent * sphere.extent - height * height).max(0.0).sqrt() * inverse_radius;
    if surface.shape >= scene.sphere_count && rho > 0.0 && distance > rho && distance - rho < 1.0 {
        covered_by_circle(kernel, distance, rho)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::packing::Packed;
    use crate::program::features::Features;
    use crate::records::{PLANE, Shape};

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
            // Half of the disc lies beyond a chord through the centre, and nothing beyond one at the rim.
            assert!((part_left(kernel, &[(0.0, 0.0)]) - 0.5).abs() < 1e-6, "{kernel:?}");
            assert!((part_left(kernel, &[(0.0, 0.999_999)]) - 1.0).abs() < 1e-6, "{kernel:?}");
        }
        assert!((integrate(DensityKernel::Cone, 1000, |x, _| x < 0.9) - 1.0).abs() > LATTICE, "a lost rim must show");
    }

    /// What planes leave of the kernel's integral around a point: each by its chord's direction in degrees and distance in
    /// radii, and the sine of its angle with the surface. The surface is tilted, so that no axis is spared.
    fn part_of_planes(kernel: DensityKernel, position: DVec3, planes: &[(f64, f64, f64)]) -> f64 {
        let tilt = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
        let radius = 0.2;
        let shape = |anchor: DVec3, offset: f64| Shape {
            anchor: anchor.as_vec3().to_array(),
            extent: offset as f32,
            kind: PLANE,
            ..Shape::default()
        };
        let own = shape(tilt * DVec3::Z, (tilt * DVec3::Z).dot(position));
        let others = planes.iter().map(|(degrees, distance, sine)| {
            let (y, x) = degrees.to_radians().sin_cos();
            let towards = tilt * DVec3::new(x, y, 0.0);
            let normal = tilt * (DVec3::new(x, y, 0.0) * *sine + DVec3::Z * (1.0 - sine * sine).sqrt());
            shape(normal, normal.dot(position + towards * (distance * radius)))
        });
        let shapes = [own].into_iter().chain(others).collect();
        let packed = Packed { shapes, ..Packed::default() };
        let features = Features::reachable()[0]; // any: clipping asks for none
        let scene = SceneTables::new(&packed, &features);
        let normal = (tilt * DVec3::Z).as_vec3();
        let surface = Surface { position: position.as_vec3(), normal, shape: 0, side: 1.0 };
        let gathering = Gathering { density_kernel: kernel, ..Gathering::default() };
        f64::from(visible_part(&scene, &gathering, &surface, 1.0 / radius as f32))
    }

    /// The same of chords whose planes lean differently.
    fn part_left(kernel: DensityKernel, chords: &[(f64, f64)]) -> f64 {
        let sines = [1.0, 0.8, 0.5, 0.2].into_iter().cycle();
        let planes: Vec<_> = chords.iter().zip(sines).map(|((degrees, h), sine)| (*degrees, *h, sine)).collect();
        part_of_planes(kernel, DVec3::ZERO, &planes)
    }

    /// Whether a point lies on the centre's side of all chords.
    fn is_left(chords: &[(f64, f64)], x: f64, y: f64) -> bool {
        chords.iter().all(|(degrees, distance)| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            x * cosine + y * sine <= *distance
        })
    }

    #[test]
    fn one_chord_has_a_closed_form() {
        for kernel in DensityKernel::ALL {
            for h in [0.01, 0.2, 0.5, 0.77, 0.95] {
                let (closed, numeric) = (part_left(kernel, &[(0.0, h)]), integrate(kernel, 1000, |x, _| x <= h));
                assert!((closed - numeric).abs() < LATTICE, "{kernel:?} at {h}: {closed} against {numeric}");
            }
        }
    }

    #[test]
    fn two_chords_are_exact_at_any_angle() {
        for kernel in DensityKernel::ALL {
            for degrees in [1.0f64, 10.0, 45.0, 90.0, 120.0, 170.0, 180.0] {
                for (a, b) in [(0.1, 0.2), (0.5, 0.05), (0.7, 0.7), (0.3, 0.9), (0.0, 0.4), (0.6, 0.6)] {
                    let chords = [(20.0, a), (20.0 + degrees, b)];
                    let closed = part_left(kernel, &chords);
                    let numeric = integrate(kernel, 500, |x, y| is_left(&chords, x, y));
                    // Twice as coarse a lattice, two edges.
                    let close = (closed - numeric).abs() < 4.0 * LATTICE;
                    assert!(close, "{kernel:?}, {a} and {b} at {degrees}°: {closed} against {numeric}");
                }
            }
        }
    }

    #[test]
    fn planes_that_lie_in_one_another_count_once() {
        for kernel in DensityKernel::ALL {
            // Away from the origin a point on the line is on either side of it.
            let far = DVec3::new(1.3, -0.4, 2.1);
            for (position, h) in [(DVec3::ZERO, 0.0), (DVec3::ZERO, 0.3), (far, 0.3), (far, 0.8)] {
                for sines in [[1.0, 1.0], [0.1, 0.1], [0.05, 0.05], [0.3, 1.0], [1.0, 0.3]] {
                    let planes = sines.map(|sine| (77.0, h, sine));
                    let once = part_of_planes(kernel, position, &planes[..1]);
                    let often = part_of_planes(kernel, position, &planes);
                    // Numbers of some metres are known to 1e-7: divided by R and the sine, that moves the chord.
                    assert!((once - often).abs() < 1e-3, "{kernel:?} at {h}, sines {sines:?}: {once} and {often}");
                }
            }
        }
    }

    #[test]
    fn corners_leave_what_their_angle_leaves() {
        for kernel in DensityKernel::ALL {
            for h in [0.0, 1e-7, 1e-6, 1e-5] {
                for (degrees, left) in [(90.0, 0.25), (150.0, 30.0 / 360.0), (30.0, 150.0 / 360.0)] {
                    let found = part_left(kernel, &[(10.0, h), (10.0 + degrees, h)]);
                    assert!((found - left).abs() < 1e-4, "{kernel:?}, {degrees}° at {h}: {found}");
                }
            }
        }
    }

    proptest::proptest! {
        #![proptest_config(proptest::prelude::ProptestConfig::with_cases(200))]
        #[test]
        fn any_number_of_chords_leaves_what_integrating_finds(
            chords in proptest::collection::vec((0.0f64..360.0, 0.0f64..1.2), 0..8),
            kernel in 0usize..4,
        ) {
            let kernel = DensityKernel::ALL[kernel];
            let (closed, numeric) = (part_left(kernel, &chords), integrate(kernel, 300, |x, y| is_left(&chords, x, y)));
            // More than three times as coarse a lattice, and up to eight edges, which mostly cancel.
            let close = (closed - numeric).abs() < 12.0 * LATTICE;
            proptest::prop_assert!(close, "{:?}, {:?}: {} against {}", kernel, chords, closed, numeric);
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
    fn products_and_pairs_would_be_seen_to_be_wrong() {
        let kernel = DensityKernel::Epanechnikov;
        let left = |chords: &[(f64, f64)]| part_left(kernel, chords);
        let truth = |chords: &[(f64, f64)]| integrate(kernel, 1000, |x, y| is_left(chords, x, y));
        let [a, b, c] = [(0.0, 0.2), (90.0, 0.3), (45.0, 0.1)];
        let product = left(&[a]) * left(&[b]);
        assert!((left(&[a, b]) - truth(&[a, b])).abs() < LATTICE);
        assert!((product - truth(&[a, b])).abs() > 4.0 * LATTICE, "the product is {product}");
        // Of three chords, what each cuts off and what each two cut off together do not tell the whole.
        let pairs = left(&[a, b]) + left(&[b, c]) + left(&[a, c]) - left(&[a]) - left(&[b]) - left(&[c]);
        assert!((left(&[a, b, c]) - truth(&[a, b, c])).abs() < LATTICE);
        assert!((pairs - truth(&[a, b, c])).abs() > 4.0 * LATTICE, "by pairs {pairs}");
    }
}
