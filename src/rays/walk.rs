//! Twin of `glsl/shared/sampling.glsl` and `walk.glsl`: a photon's way from a light over the surfaces.

use glam::Vec3;

use super::bsdf::smith_v;
use super::camera::normalize3;
use super::random::{R4_STEPS, hash_u, sequence_u, unit_real};
use super::scene::{SceneTables, Surface};
use crate::rays::emission::{CELL_BITS, CELLS, COLUMNS_LOG2, EmissionPlan, PART_BITS, ROWS_LOG2, Sampler};
use crate::records::Emitter;

/// (cos, sin) of 2π·(turn/2³² − 1/8).
pub fn unit_circle(turn: u32) -> (f32, f32) {
    let a = (unit_real(turn << 2) - 0.5) * std::f32::consts::FRAC_PI_2;
    let a2 = a * a;
    let sine = a * (1.0 + a2 * (-0.166_666_67 + a2 * (8.333_333e-3 + a2 * (-1.984_127e-4 + a2 * 2.755_731_9e-6))));
    let cosine = 1.0 + a2 * (-0.5 + a2 * (4.166_666_7e-2 + a2 * (-1.388_888_9e-3 + a2 * 2.480_158_7e-5)));
    match turn >> 30 {
        0 => (cosine, sine),
        1 => (-sine, cosine),
        2 => (-cosine, -sine),
        _ => (sine, -cosine),
    }
}

/// Unit vector at height y and a turn about the y axis.
pub fn sphere_at(height: f32, turn: u32) -> Vec3 {
    let (x, z) = unit_circle(turn);
    let radius = (1.0 - height * height).max(0.0).sqrt();
    Vec3::new(radius * x, height, radius * z)
}

/// Unit vector, uniform over the sphere.
pub fn sample_sphere(height: u32, turn: u32) -> Vec3 {
    sphere_at(1.0 - 2.0 * unit_real(height), turn)
}

/// Unit vector about `normal` with density cosθ/π.
pub fn sample_cosine(normal: Vec3, height: u32, turn: u32) -> Vec3 {
    let mut d = normal + sample_sphere(height, turn);
    // A short sum is rounding more than direction; its part along the normal is half its squared length.
    if d.dot(d) < 1.0e-5 {
        d += normal * (0.5 * d.dot(d).max(1.0e-10) - d.dot(normal));
    }
    d * (1.0 / d.dot(d).sqrt())
}

/// Half vector of visible GGX facets (Dupuy & Benyoub, HPG 2023).
pub fn sample_ggx(normal: Vec3, to_viewer: Vec3, alpha: f32, height: u32, turn: u32) -> Vec3 {
    let sign_z = 1.0f32.copysign(normal.z);
    let a = -1.0 / (sign_z + normal.z);
    let n = normal;
    let tangent = Vec3::new(1.0 + sign_z * n.x * n.x * a, sign_z * n.x * n.y * a, 0.0 - sign_z * n.x);
    let bitangent = Vec3::new(n.x * n.y * a, sign_z + n.y * n.y * a, 0.0 - n.y);
    let x = to_viewer.dot(tangent) * alpha;
    let y = to_viewer.dot(bitangent) * alpha;
    let z = to_viewer.dot(normal);
    let length = (x * x + y * y + z * z).sqrt();
    let cap = z / length;
    let (cosine, sine) = unit_circle(turn);
    let h = 1.0 - unit_real(height) * (1.0 + cap);
    let radius = (1.0 - h * h).max(0.0).sqrt();
    let hx = (radius * cosine + x / length) * alpha;
    let hy = (radius * sine + y / length) * alpha;
    let hz = (h + cap).max(1.0e-7);
    normalize3(tangent * hx + bitangent * hy + normal * hz)
}

/// Smith's G1 for GGX.
pub fn smith_g1(cosine: f32, alpha: f32) -> f32 {
    2.0 * cosine * smith_v(cosine, alpha)
}

/// A photon under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Scene space, where it comes from.
    pub position: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// Relative to `power`.
    pub throughput: Vec3,
    /// Watts.
    pub power: f32,
    /// That it leaves; `None` for a light.
    pub face: Option<usize>,
    /// 0 until the first hit.
    pub bounce: u32,
    /// Of this bounce's numbers.
    pub key: u32,
    /// The first bounce's numbers.
    pub height: u32,
    /// See `height`.
    pub turn: u32,
}

/// Number `dimension` of one bounce.
pub fn number_u(key: u32, dimension: u32) -> u32 {
    hash_u(key.wrapping_add(dimension.wrapping_mul(0x9e37_79b9)))
}

/// The start of a path; paths count from 0 over all lights. `stream`: hash of seed and pass.
pub fn emit_photon(plan: &EmissionPlan, emitters: &[Emitter], sampler: Sampler, path: u32, stream: u32) -> Photon {
    let key = hash_u(path ^ stream);
    let slot = plan.slots[(path & ((1 << plan.slots_log2) - 1)) as usize];
    let light = slot >> plan.slots_log2;
    let [own_slots, first_cell, cells] = plan.counts[light as usize];
    let rank = slot & ((1 << plan.slots_log2) - 1);
    let index = (path >> plan.slots_log2).wrapping_mul(own_slots).wrapping_add(rank);
    let shift = if emitters.len() == 1 { stream } else { hash_u(stream ^ light) };
    let number = |d: usize| match sampler {
        Sampler::Random => number_u(key, 4 + d as u32),
        Sampler::Sequence => sequence_u(index, R4_STEPS[d], number_u(shift, 4 + d as u32)),
    };
    let (height, turn) = (number(0), number(1));
    let mut parts = 1.0;
    let direction = if plan.cells.is_empty() {
        sample_sphere(height, turn)
    } else {
        let chosen = u64::from(height) * u64::from(cells);
        let entry = plan.cells[(first_cell + (chosen >> 32) as u32) as usize];
        let cell = entry & (CELLS as u32 - 1);
        parts = (entry >> CELL_BITS & ((1 << PART_BITS) - 1)) as f32;
        let part = (entry >> (CELL_BITS + PART_BITS)) as f32;
        let (row, column) = (cell >> COLUMNS_LOG2, cell & ((1 << COLUMNS_LOG2) - 1));
        let z = 1.0 - (row as f32 + (part + unit_real(chosen as u32)) / parts) * (2.0 / (1 << ROWS_LOG2) as f32);
        sphere_at(z, (column << (32 - COLUMNS_LOG2)).wrapping_add(turn >> COLUMNS_LOG2))
    };
    let emitter = &emitters[light as usize];
    Photon {
        position: emitter.position.into(),
        direction,
        throughput: emitter.color.into(),
        power: emitter.power / parts,
        face: None,
        bounce: 0,
        key,
        height: number(2),
        turn: number(3),
    }
}

/// What happens to a photon that arrives at a surface: `None` when it is absorbed.
pub fn scatter(scene: &SceneTables, photon: &Photon, surface: &Surface) -> Option<Photon> {
    let material = scene.material_of(surface.shape);
    let before = photon.throughput.max_element();
    let diffuse = photon.throughput * (Vec3::from(material.color) * material.diffuse);
    let after = diffuse.max_element();
    let specular = if scene.features.glossy { material.specular } else { 0.0 };
    let kept = after + specular * before;
    let limit = if photon.bounce >= 16 && kept > 0.95 * before { 0.95 * before / kept } else { 1.0 };
    let chance = unit_real(number_u(photon.key, 0)) * before;
    // Without power nothing is less than anything, and no photon goes on.
    let survives = chance < kept * limit;
    if !survives {
        return None;
    }
    let (height, turn) = match photon.bounce {
        0 => (photon.height, photon.turn),
        _ => (number_u(photon.key, 1), number_u(photon.key, 2)),
    };
    let mut next = Photon {
        position: surface.position,
        face: Some(surface.face_left()),
        bounce: photon.bounce + 1,
        key: hash_u(photon.key),
        ..*photon
    };
    if chance < after * limit {
        next.direction = sample_cosine(surface.normal, height, turn);
        next.throughput = diffuse * (before / (after * limit));
    } else {
        let to_viewer = -photon.direction;
        let half_way = sample_ggx(surface.normal, to_viewer, material.roughness, height, turn);
        let mirrored = half_way * (2.0 * half_way.dot(to_viewer)) - to_viewer;
        let cosine = mirrored.dot(surface.normal);
        if cosine <= 0.0 {
            return None;
        }
        next.direction = normalize3(mirrored);
        next.throughput = photon.throughput * (smith_g1(cosine, material.roughness) / limit);
    }
    Some(next)
}
