//! The BSDF of DESIGN §2, evaluated and sampled in double precision, with densities in both directions for MIS.
//!
//! Directions are unit, point away from the surface and are in world space; `normal` lies on the side of `outgoing`.
//! Diffuse and GGX lobes are functions; a perfect mirror and a smooth dielectric are delta lobes, which can be sampled
//! but never evaluated or connected to.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::materials::Material;

/// Value and densities of the non-delta lobes for a pair of directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evaluation {
    /// f, per steradian, without a cosine.
    pub value: DVec3,
    /// Density of sampling the incident direction from the outgoing one, per steradian.
    pub pdf: f64,
    /// Density of sampling the outgoing direction from the incident one, per steradian.
    pub pdf_reverse: f64,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatter {
    /// Where the path goes on, unit.
    pub direction: DVec3,
    /// What the throughput is multiplied by: f·|cos|/pdf.
    pub weight: DVec3,
    /// Density of `direction`, per steradian; 0 for a delta lobe.
    pub pdf: f64,
    /// Density of the opposite choice, per steradian; 0 for a delta lobe.
    pub pdf_reverse: f64,
    /// Sampled from a delta lobe.
    pub delta: bool,
}

/// A material with everything that does not depend on directions worked out.
pub(super) struct Bsdf {
    /// The Lambertian lobe, kd·c/π, per steradian.
    diffuse: DVec3,
    /// ks of the rough lobe; 0 where the lobe is a mirror.
    glossy: f64,
    alpha: f64,
    /// Share of the perfect mirror, ks.
    mirror: f64,
    /// Share of the smooth dielectric, kt.
    dielectric: f64,
    ior: f64,
    /// Probabilities of sampling the diffuse, glossy, mirror and dielectric lobes; sum 1, or all 0 for a black surface.
    choice: [f64; 4],
    /// ambient·c: constant added to the outgoing radiance.
    pub ambient: DVec3,
}

impl Bsdf {
    pub fn new(material: &Material) -> Self {
        let rough = material.roughness > 0.0;
        let glossy = if rough { material.specular } else { 0.0 };
        let mirror = if rough { 0.0 } else { material.specular };
        let shares = [material.diffuse * material.color.max_element(), glossy, mirror, material.transmission];
        let total: f64 = shares.iter().sum();
        Self {
            diffuse: material.color * (material.diffuse / PI),
            glossy,
            alpha: material.roughness,
            mirror,
            dielectric: material.transmission,
            ior: material.ior,
            choice: shares.map(|share| if total > 0.0 { share / total } else { 0.0 }),
            ambient: material.color * material.ambient,
        }
    }

    /// Whether some lobe is a function, so that light can be connected to the surface.
    #[inline]
    pub fn connectible(&self) -> bool {
        self.choice[0] + self.choice[1] > 0.0
    }

    /// Whether there is no other lobe than the diffuse one.
    pub fn only_diffuse(&self) -> bool {
        self.choice[0] >= 1.0 || self.choice == [0.0; 4]
    }

    /// The diffuse lobe, kd·c/π.
    #[inline]
    pub fn diffuse(&self) -> DVec3 {
        self.diffuse
    }

    /// Whether some lobe is a delta function.
    pub fn has_delta(&self) -> bool {
        self.choice[2] + self.choice[3] > 0.0
    }

    /// The non-delta lobes; None where the two directions lie on different sides or along the surface.
    #[inline]
    pub fn evaluate(&self, outgoing: DVec3, incident: DVec3, normal: DVec3) -> Option<Evaluation> {
        let (cos_o, cos_i) = (normal.dot(outgoing), normal.dot(incident));
        if cos_o <= 0.0 || cos_i <= 0.0 {
            return None;
        }
        let mut evaluation = Evaluation {
            value: self.diffuse,
            pdf: self.choice[0] * cos_i / PI,
            pdf_reverse: self.choice[0] * cos_o / PI,
        };
        if self.glossy > 0.0 {
            let half = (outgoing + incident).normalize();
            let density = distribution(normal.dot(half), self.alpha);
            let (mask_o, mask_i) = (masking(cos_o, self.alpha), masking(cos_i, self.alpha));
            evaluation.value += DVec3::splat(self.glossy * density * mask_o * mask_i / (4.0 * cos_o * cos_i));
            evaluation.pdf += self.choice[1] * mask_o * density / (4.0 * cos_o);
            evaluation.pdf_reverse += self.choice[1] * mask_i * density / (4.0 * cos_i);
        }
        Some(evaluation)
    }

    /// Sample the direction at the far side of `outgoing`: `u` picks it within a lobe, `lobe` in (0, 1) the lobe.
    ///
    /// `inside` says that `outgoing` lies inside a solid dielectric sphere; `radiance` that what is carried is radiance
    /// (a path from the camera), which refraction scales by the ratio of indices squared, and not flux (Veach §5.2).
    #[inline]
    pub fn sample(
        &self,
        outgoing: DVec3,
        normal: DVec3,
        u: [f64; 2],
        lobe: f64,
        inside: bool,
        radiance: bool,
    ) -> Option<Scatter> {
        let [diffuse, glossy, mirror, dielectric] = self.choice;
        let cos_o = normal.dot(outgoing);
        if cos_o <= 0.0 {
            return None;
        }
        let incident = if lobe < diffuse {
            cosine_hemisphere(normal, u)
        } else if lobe < diffuse + glossy {
            let half = visible_normal(outgoing, normal, self.alpha, u);
            half * (2.0 * outgoing.dot(half)) - outgoing
        } else if lobe < diffuse + glossy + mirror {
            let weight = DVec3::splat(self.mirror / mirror);
            return Some(Scatter::delta(normal * (2.0 * cos_o) - outgoing, weight));
        } else if dielectric > 0.0 {
            // The lobe's own share of the number decides between reflection and refraction.
            let within = (lobe - (1.0 - dielectric)) / dielectric;
            return Some(self.refract(outgoing, normal, cos_o, within, inside, radiance));
        } else {
            return None;
        };
        let evaluation = self.evaluate(outgoing, incident, normal)?;
        Some(Scatter {
            direction: incident,
            weight: evaluation.value * (normal.dot(incident) / evaluation.pdf),
            pdf: evaluation.pdf,
            pdf_reverse: evaluation.pdf_reverse,
            delta: false,
        })
    }

    fn refract(&self, outgoing: DVec3, normal: DVec3, cos_o: f64, u: f64, inside: bool, radiance: bool) -> Scatter {
        let weight = DVec3::splat(self.dielectric / self.choice[3]);
        let eta = if inside { 1.0 / self.ior } else { self.ior }; // far side over near side
        let sin2_t = (1.0 - cos_o * cos_o) / (eta * eta);
        let cos_t = (1.0 - sin2_t).max(0.0).sqrt();
        if sin2_t >= 1.0 || u < fresnel(cos_o, cos_t, eta) {
            return Scatter::delta(normal * (2.0 * cos_o) - outgoing, weight);
        }
        let direction = (-outgoing / eta + normal * (cos_o / eta - cos_t)).normalize();
        Scatter::delta(direction, if radiance { weight / (eta * eta) } else { weight })
    }
}

impl Scatter {
    fn delta(direction: DVec3, weight: DVec3) -> Self {
        Self { direction, weight, pdf: 0.0, pdf_reverse: 0.0, delta: true }
    }
}

/// Unpolarised Fresnel reflectance of a dielectric; `eta` is the far side's index over the near side's.
fn fresnel(cos_near: f64, cos_far: f64, eta: f64) -> f64 {
    let parallel = (eta * cos_near - cos_far) / (eta * cos_near + cos_far);
    let perpendicular = (cos_near - eta * cos_far) / (cos_near + eta * cos_far);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// GGX density of microfacet normals D(h), per steradian (Walter et al. 2007).
#[inline]
fn distribution(cos_h: f64, alpha: f64) -> f64 {
    let a2 = alpha * alpha;
    // 1 − cos² from below would cancel near the peak, but only where it is far smaller than any α² in use.
    let k = cos_h * cos_h * (a2 - 1.0) + 1.0;
    a2 / (PI * k * k)
}

/// Smith's G₁ for GGX.
#[inline]
fn masking(cos: f64, alpha: f64) -> f64 {
    let a2 = alpha * alpha;
    2.0 * cos / (cos + (a2 + (1.0 - a2) * cos * cos).sqrt())
}

/// Two tangents that make a right-handed orthonormal frame with a unit `normal` (Duff et al. 2017).
#[inline]
pub(super) fn tangents(normal: DVec3) -> (DVec3, DVec3) {
    let sign = 1f64.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (
        DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        DVec3::new(b, sign + normal.y * normal.y * a, -normal.y),
    )
}

/// A direction about `normal` with density cos/π.
#[inline]
pub(super) fn cosine_hemisphere(normal: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let (sin_phi, cos_phi) = (TAU * u).sin_cos();
    let radius = v.sqrt();
    let (s, t) = tangents(normal);
    (s * (radius * cos_phi) + t * (radius * sin_phi) + normal * (1.0 - v).sqrt()).normalize()
}

/// A direction uniform over the sphere, density 1/4π.
#[inline]
pub(super) fn uniform_sphere([u, v]: [f64; 2]) -> DVec3 {
    let (sin_phi, cos_phi) = (TAU * u).sin_cos();
    let z = 1.0 - 2.0 * v;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(radius * cos_phi, radius * sin_phi, z)
}

/// A GGX normal in proportion to its visibility from `outgoing` (Dupuy & Benyoub 2023, spherical caps).
#[inline]
fn visible_normal(outgoing: DVec3, normal: DVec3, alpha: f64, [u, v]: [f64; 2]) -> DVec3 {
    let (s, t) = tangents(normal);
    let stretched = DVec3::new(alpha * outgoing.dot(s), alpha * outgoing.dot(t), outgoing.dot(normal)).normalize();
    let (sin_phi, cos_phi) = (TAU * u).sin_cos();
    let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let half = DVec3::new(radius * cos_phi, radius * sin_phi, z) + stretched;
    let local = DVec3::new(alpha * half.x, alpha * half.y, half.z.max(0.0)).normalize();
    s * local.x + t * local.y + normal * local.z
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(diffuse: f64, specular: f64, roughness: f64, transmission: f64) -> Material {
        Material {
            name: "test".into(),
            color: DVec3::new(0.9, 0.5, 0.2),
            diffuse,
            specular,
            roughness,
            transmission,
            ior: 1.5,
            ambient: 0.0,
        }
    }

    fn tilted(cos: f64) -> DVec3 {
        DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
    }

    /// Midpoints of an n×n square, the rule for all integrals below.
    fn square(n: usize) -> impl Iterator<Item = [f64; 2]> {
        let at = move |i: usize| (i as f64 + 0.5) / n as f64;
        (0..n * n).map(move |k| [at(k % n), at(k / n)])
    }

    /// ∫ D cos = 1 and, per direction, the mean over visible normals: G₁ is D's own masking.
    #[test]
    fn ggx_is_normalised_and_masking_belongs_to_it() {
        for alpha in [0.1, 0.4, 1.0] {
            let n = 2000;
            let mut area = 0.0;
            for i in 0..n {
                // cosθ = 1/√(1 + α²x/(1−x)) spreads nodes like D itself, so that a narrow peak is resolved.
                let x = (i as f64 + 0.5) / n as f64;
                let cos2 = (1.0 - x) / (1.0 + (alpha * alpha - 1.0) * x);
                let jacobian = alpha * alpha / (1.0 + (alpha * alpha - 1.0) * x).powi(2); // d(cos²)/dx
                area += distribution(cos2.sqrt(), alpha) * PI * jacobian / n as f64; // 2π cosθ d(cosθ) = π d(cos²)
            }
            assert!((area - 1.0).abs() < 1e-9, "alpha {alpha}: {area}");
        }
        for (alpha, cos) in [(0.3, 0.2), (0.5, 0.7), (1.0, 0.9)] {
            let outgoing = tilted(cos);
            let seen: f64 = square(1200)
                .map(|u| {
                    let h = uniform_sphere([u[0], u[1] * 0.5]); // upper half: z > 0
                    distribution(h.z, alpha) * outgoing.dot(h).max(0.0) * TAU
                })
                .sum::<f64>()
                / 1.44e6;
            let projected = seen * masking(cos, alpha);
            assert!((projected - cos).abs() < 2e-3 * cos, "alpha {alpha}, cos {cos}: {projected}");
        }
    }

    /// What sampling returns on average is what integrating the BSDF returns, diffuse and glossy together.
    #[test]
    fn sampled_albedo_is_the_integrated_albedo() {
        for (kd, ks, alpha, cos) in
            [(1.0, 0.0, 0.0, 0.6), (0.0, 1.0, 0.3, 0.9), (0.5, 0.4, 0.25, 0.4), (0.3, 0.7, 1.0, 0.1)]
        {
            let bsdf = Bsdf::new(&material(kd, ks, alpha, 0.0));
            let (outgoing, normal) = (tilted(cos), DVec3::Z);
            let n = 1000;
            let mut integrated = DVec3::ZERO;
            let mut density = 0.0;
            for u in square(n) {
                let incident = uniform_sphere([u[0], u[1] * 0.5]);
                if let Some(e) = bsdf.evaluate(outgoing, incident, normal) {
                    integrated += e.value * (incident.z * TAU / (n * n) as f64);
                    density += e.pdf * TAU / (n * n) as f64;
                    let back = bsdf.evaluate(incident, outgoing, normal).unwrap();
                    assert!((back.value - e.value).length() <= 1e-12 * e.value.length(), "not reciprocal");
                    assert!((back.pdf - e.pdf_reverse).abs() <= 1e-12 * back.pdf);
                }
            }
            let mut sampled = DVec3::ZERO;
            let mut below = 0.0;
            let (m, lobes) = (100, 200); // enough lobes that their rounded shares do not show
            for u in square(m) {
                for lobe in 0..lobes {
                    let lobe = (lobe as f64 + 0.5) / lobes as f64;
                    match bsdf.sample(outgoing, normal, u, lobe, false, true) {
                        Some(s) => sampled += s.weight / (m * m * lobes) as f64,
                        None => below += 1.0 / (m * m * lobes) as f64,
                    }
                }
            }
            assert!((sampled - integrated).abs().max_element() < 3e-3, "{kd} {ks} {alpha}: {sampled} {integrated}");
            // Reflections that end below the surface are the density's missing part.
            assert!((density + below - 1.0).abs() < 3e-3, "{kd} {ks} {alpha}: {density} + {below}");
        }
    }

    /// The density really is that of the samples: χ² over 8×8 cells of the hemisphere.
    #[test]
    fn samples_follow_their_density() {
        let chi2 = |claimed: f64| {
            let bsdf = Bsdf::new(&material(0.4, 0.5, 0.35, 0.0));
            let (outgoing, normal) = (tilted(0.5), DVec3::Z);
            let cell = |d: DVec3| {
                let phi = (d.y.atan2(d.x) / TAU).rem_euclid(1.0);
                (((d.z * 8.0) as usize).min(7)) * 8 + ((phi * 8.0) as usize).min(7)
            };
            let mut expected = [0.0; 64];
            for u in square(800) {
                let d = uniform_sphere([u[0], u[1] * 0.5]);
                expected[cell(d)] += bsdf.evaluate(outgoing, d, normal).map_or(0.0, |e| e.pdf) * TAU / 640_000.0;
            }
            let n = 200_000;
            let mut counts = [0.0; 64];
            // Additive recurrence (R3): even, but not aligned with the cells.
            for i in 0..n {
                let at = |step: f64| (0.5 + f64::from(i) * step).fract();
                let (u, lobe) = ([at(0.819_172_513_396_164), at(0.671_043_606_703_789)], at(0.549_700_477_901_970));
                if let Some(s) = bsdf.sample(outgoing, normal, u, lobe, false, true) {
                    counts[cell(s.direction)] += 1.0;
                }
            }
            let n = f64::from(n);
            counts
                .iter()
                .zip(expected)
                .filter(|(_, e)| n * e > 5.0)
                .map(|(count, e)| (count - claimed * n * e).powi(2) / (claimed * n * e))
                .sum::<f64>()
        };
        // 64 cells: random points would give 64 ± 11, even points less.
        assert!(chi2(1.0) < 100.0, "{}", chi2(1.0));
        assert!(chi2(1.03) > 100.0, "a density 3% too high must be noticed: {}", chi2(1.03));
    }

    /// Smooth glass: Snell's law, Fresnel at normal incidence, total reflection, and radiance scaled going in and out.
    #[test]
    fn glass_refracts() {
        let bsdf = Bsdf::new(&material(0.0, 0.0, 0.0, 1.0));
        assert!(bsdf.has_delta() && !bsdf.connectible());
        let outgoing = tilted(0.8); // sin 0.6
        let inward = bsdf.sample(outgoing, DVec3::Z, [0.5; 2], 0.9999, false, true).unwrap();
        assert!((inward.direction.x + 0.4).abs() < 1e-12 && inward.direction.z < 0.0);
        assert!((inward.weight.x - 1.0 / 2.25).abs() < 1e-12);
        let flux = bsdf.sample(outgoing, DVec3::Z, [0.5; 2], 0.9999, false, false).unwrap();
        assert!((flux.weight.x - 1.0).abs() < 1e-12);
        let trapped = bsdf.sample(outgoing, DVec3::Z, [0.5; 2], 0.9999, true, true);
        let past_critical = bsdf.sample(tilted(0.5), DVec3::Z, [0.5; 2], 0.9999, true, true).unwrap();
        assert!(trapped.unwrap().direction.z < 0.0 && past_critical.direction.z > 0.0);
        assert!((fresnel(1.0, 1.0, 1.5) - 0.04).abs() < 1e-12);
    }
}
