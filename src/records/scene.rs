//! Records of the scene and of one picture of it.

use bytemuck::{Pod, Zeroable};

use super::record::{Field, Record, TEXEL, record};
use crate::kinds::ShapeKind;

record! {
    /// What rays meet, of any kind: two texels. Kinds follow each other in the table in the order of [`crate::kinds`].
    Shape, "shape" in "shapes" {
        /// Sphere: centre; plane: unit normal. Scene space (metres from the pack's origin).
        anchor: [f32; 3],
        /// Sphere: radius; plane: `dot(normal, p)` of its points. Metres.
        extent: f32,
        /// Its row of the material table.
        material: f32,
        /// Number of its kind, [`SPHERE`] or [`PLANE`]; programs know it from the place in the table.
        kind: f32,
    }
}

record! {
    /// What a quad has besides its plane: coordinates u and v along its edges, each in [−1, 1] on the quad.
    Quad, "quad" in "quads" {
        /// u = `dot(across_u, p) + offset_u`; scene space, 1/m. In the quad's plane, and across its second edge.
        across_u: [f32; 3],
        /// The same of v, across its first edge.
        across_v: [f32; 3],
        /// See `across_u`.
        offset_u: f32,
        /// See `across_v`.
        offset_v: f32,
        /// Of all quads, the same in every row: a scene without any has no room for it in its frame.
        count: f32,
    }
}

/// [`Shape::kind`] of a sphere.
pub const SPHERE: f32 = ShapeKind::Sphere.number();
/// [`Shape::kind`] of a plane.
pub const PLANE: f32 = ShapeKind::Plane.number();

record! {
    /// How surfaces scatter: three texels, the last of which only scenes with ambient light or glass ask for.
    Material, "material" in "materials" {
        /// Albedo of the diffuse part, linear Rec. 709.
        color: [f32; 3],
        /// kd.
        diffuse: f32,
        /// ks.
        specular: f32,
        /// GGX α.
        roughness: f32,
        /// `ambient · color` is added to the outgoing radiance.
        ambient: f32,
        /// kt.
        transmission: f32,
        /// Index of refraction.
        ior: f32,
    }
}

record! {
    /// A point light: two texels.
    Light, "light" in "lights" {
        /// Scene space, metres.
        position: [f32; 3],
        /// Radiant intensity, W/sr per channel.
        intensity: [f32; 3],
    }
}

record! {
    /// What one picture needs besides the scene: camera, counts, sampling. Uniforms in GL, a small buffer in OpenCL.
    Frame, "frame" in "frame" {
        /// Camera, scene space, metres.
        position: [f32; 3],
        /// Half the image plane's width at distance 1, pointing to the image's right.
        right: [f32; 3],
        /// Half the image plane's height at distance 1, pointing to the image's top.
        up: [f32; 3],
        /// Unit viewing direction.
        forward: [f32; 3],
        /// Pixels.
        width: f32,
        /// Pixels.
        height: f32,
        /// Samples per pixel in this picture.
        samples: f32,
        /// Number of spheres in the object table.
        sphere_count: f32,
        /// Number of planes after them.
        plane_count: f32,
        /// Number of lights.
        light_count: f32,
        /// Low 16 bits of the seed.
        seed_low: f32,
        /// High 16 bits of the seed.
        seed_high: f32,
        /// Number of the first sample: passes go on where the last one stopped.
        first_sample: f32,
    }
}
