//! Twin of `glsl/shared/bsdf.glsl`: the GGX lobe (Walter et al., EGSR 2007).

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::camera::normalize3;

/// GGX distribution for α > 0.
pub fn ggx_d(normal: Vec3, half_way: Vec3, alpha: f32) -> f32 {
    let across = normal.cross(half_way);
    let cos_h = normal.dot(half_way);
    let alpha2 = alpha * alpha;
    let denominator = across.dot(across) + alpha2 * cos_h * cos_h;
    alpha2 * FRAC_1_PI / (denominator * denominator)
}

/// Half of Smith's G1 over cosθ: G/(4 cosθi cosθo) is the product of two of these.
pub fn smith_v(cosine: f32, alpha: f32) -> f32 {
    1.0 / (cosine + (cosine * cosine + alpha * alpha * (1.0 - cosine * cosine)).sqrt())
}

/// The GGX lobe's value, D·G/(4 cosθi cosθo); both cosines are positive.
pub fn ggx(normal: Vec3, to_viewer: Vec3, to_light: Vec3, cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let half_way = normalize3(to_viewer + to_light);
    ggx_d(normal, half_way, alpha) * smith_v(cos_o, alpha) * smith_v(cos_i, alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ D(h) cosθh dh over the hemisphere, in polar coordinates with the grid dense near the pole.
    fn projected_area(alpha: f32) -> f64 {
        let steps = 40_000;
        (0..steps)
            .map(|i| {
                // θ = (π/2)·s³ puts points where a narrow lobe is.
                let s = (f64::from(i) + 0.5) / f64::from(steps);
                let theta = std::f64::consts::FRAC_PI_2 * s.powi(3);
                let d_theta = std::f64::consts::FRAC_PI_2 * 3.0 * s * s / f64::from(steps);
                let half_way = Vec3::new(theta.sin() as f32, 0.0, theta.cos() as f32);
                f64::from(ggx_d(Vec3::Z, half_way, alpha)) * theta.cos() * theta.sin() * d_theta * std::f64::consts::TAU
            })
            .sum()
    }

    #[test]
    fn facets_of_the_distribution_cover_the_surface_once() {
        for alpha in [1.0, 0.5, 0.1, 0.01, 0.001] {
            let area = projected_area(alpha);
            // 1e-4: float32 directions near the pole at α = 0.001; the quadrature itself is at 1e-8.
            assert!((area - 1.0).abs() < 1e-4, "α = {alpha}: {area}");
        }
        assert!((projected_area(0.1) * 1.001 - 1.0).abs() > 1e-4, "a lobe 0.1% off must show");
    }

    #[test]
    fn the_lobe_follows_its_definition() {
        // D·G/(4 cosθi cosθo) from the textbook's formulas in double precision.
        let textbook = |n: Vec3, o: Vec3, i: Vec3, alpha: f64| {
            let h = (o + i).normalize();
            let (ch, co, ci) = (f64::from(n.dot(h)), f64::from(n.dot(o)), f64::from(n.dot(i)));
            let d = alpha.powi(2) / (std::f64::consts::PI * (ch * ch * (alpha.powi(2) - 1.0) + 1.0).powi(2));
            let g1 = |c: f64| 2.0 / (1.0 + (1.0 + alpha.powi(2) * (1.0 - c * c) / (c * c)).sqrt());
            d * g1(co) * g1(ci) / (4.0 * co * ci)
        };
        for (o, i) in [((0.3, 0.1, 0.9), (-0.2, 0.4, 0.7)), ((0.9, 0.0, 0.1), (-0.9, 0.1, 0.05))] {
            let (o, i) = (Vec3::from(o).normalize(), Vec3::from(i).normalize());
            for alpha in [1.0f32, 0.3, 0.05] {
                let (ours, theirs) =
                    (f64::from(ggx(Vec3::Z, o, i, o.z, i.z, alpha)), textbook(Vec3::Z, o, i, alpha.into()));
                // 1e-4: the textbook's denominator cancels for float32 directions at small α.
                assert!((ours / theirs - 1.0).abs() < 1e-4, "α = {alpha}: {ours} against {theirs}");
            }
        }
    }

    #[test]
    fn light_and_viewer_may_be_exchanged() {
        let (o, i) = (Vec3::new(0.3, 0.1, 0.9).normalize(), Vec3::new(-0.6, 0.4, 0.2).normalize());
        let (there, back) = (ggx(Vec3::Z, o, i, o.z, i.z, 0.2), ggx(Vec3::Z, i, o, i.z, o.z, 0.2));
        assert!((there / back - 1.0).abs() < 1e-6);
    }
}
