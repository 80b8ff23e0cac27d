//! Twin of `glsl/shared/direct.glsl`: light that comes straight from a point light.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use crate::rays::bsdf::ggx;
use crate::rays::scene::{SceneTables, Surface};
use crate::records::Light;

/// What one light brings to a surface.
pub struct Incident {
    /// W/m².
    pub irradiance: Vec3,
    /// Unit.
    pub to_light: Vec3,
    /// Between that and the normal.
    pub cosine: f32,
}

/// `None` where the light does not reach.
pub fn incident_light(scene: &SceneTables, surface: &Surface, light: &Light) -> Option<Incident> {
    let towards = Vec3::from(light.position) - surface.position;
    let distance2 = towards.dot(towards);
    let distance = distance2.sqrt();
    let to_light = towards * (1.0 / distance);
    let cosine = surface.normal.dot(to_light);
    let position = light.position.into();
    let lit =
        cosine > 0.0 && !scene.occluded(surface.position, position, to_light, distance, surface.face_left(), None);
    let irradiance = Vec3::from(light.intensity) * (cosine / distance2);
    lit.then_some(Incident { irradiance, to_light, cosine })
}

/// Radiance towards the viewer from point lights, W·m⁻²·sr⁻¹.
pub fn direct_light(scene: &SceneTables, surface: &Surface, to_viewer: Vec3) -> Vec3 {
    let material = scene.material_of(surface.shape);
    let diffuse = Vec3::from(material.color) * (material.diffuse * FRAC_1_PI);
    let mut sum = Vec3::ZERO;
    for light in scene.lights {
        let Some(Incident { irradiance, to_light, cosine }) = incident_light(scene, surface, light) else { continue };
        let mut bsdf = diffuse;
        if material.specular > 0.0 {
            let cos_o = surface.normal.dot(to_viewer).max(0.0);
            bsdf += material.specular * ggx(surface.normal, to_viewer, to_light, cos_o, cosine, material.roughness);
        }
        sum += bsdf * irradiance;
    }
    sum
}
