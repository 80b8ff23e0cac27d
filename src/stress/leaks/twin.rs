//! Twin of the leaks' body in `glsl/shared/stress.glsl`.

use glam::Vec3;

use super::{Case, RAYS, SEED};
use crate::rays::camera::normalize3;
use crate::rays::random::{hash_u, hash2_u, unit_real};
use crate::rays::scene::{Hit, SceneTables, Surface};
use crate::rays::shapes::sphere::hit_sphere;
use crate::rays::shapes::{INFINITE, Sides};
use crate::rays::walk::{sample_cosine, sample_sphere};
use crate::stress::Fault;
use crate::stress::lab::{Answer, features};

/// Rays of one item.
pub(super) fn walk(case: &Case, item: u32, fault: Option<Fault>) -> Answer {
    let features = features(case.two_sided, true, !case.packed.quads.is_empty());
    let scene = SceneTables::new(&case.packed, &features);
    let mut key = hash2_u(item, SEED);
    let mut answer = [0; 8];
    let (mut position, mut face) = (case.start, None);
    let mut direction = sample_sphere(hash_u(key.wrapping_add(1)), hash_u(key.wrapping_add(2)));
    for ray in 1..=RAYS {
        key = hash_u(key);
        let number = |n: u32| hash_u(key.wrapping_add(n));
        answer[0] += 1;
        let hit = match fault {
            Some(Fault::FixedEpsilon) => with_epsilon(&scene, position, direction, face),
            _ => scene.closest_hit(position, direction, face),
        };
        let surface = hit.map(|hit| scene.surface_at(position, direction, hit));
        let wrong = match &surface {
            None => Some(1),
            Some(surface) => wrong(case, surface, face),
        };
        match (surface, wrong) {
            (Some(surface), None) => {
                direction = sample_cosine(surface.normal, number(1), number(2));
                if item & 1 != 0 && number(9) & 1 != 0 {
                    direction = aimed(case, &surface, key).unwrap_or(direction);
                }
                (position, face) = (surface.position, Some(surface.face_left()));
            }
            (_, wrong) => {
                answer[wrong.unwrap_or(1)] += 1;
                if answer[5] == 0 {
                    answer[5] = ray;
                }
                direction = sample_sphere(number(1), number(2));
                (position, face) = (case.start, None);
            }
        }
    }
    answer
}

/// Near a contact or an edge; none where that would go into the surface.
fn aimed(case: &Case, surface: &Surface, key: u32) -> Option<Vec3> {
    let number = |n: u32| hash_u(key.wrapping_add(n));
    let fraction = |bits: u32| f32::from_bits((127 - bits % 27) << 23);
    let [place, along] = case.places[number(3) as usize % case.places.len()];
    let target = place + along * unit_real(number(4));
    let beside = sample_sphere(number(5), number(6)) * (case.size * fraction(number(7)));
    let way = target + beside - surface.position;
    let mut direction = way * (1.0 / way.dot(way).max(1e-30).sqrt());
    let bits = number(8);
    if bits & 3 == 0 {
        direction = normalize3(direction + surface.normal * (fraction(bits >> 2) - direction.dot(surface.normal)));
    }
    (direction.dot(surface.normal) > 0.0).then_some(direction)
}

/// Which count a hit belongs to, if any.
fn wrong(case: &Case, surface: &Surface, from: Option<usize>) -> Option<usize> {
    let p = surface.position;
    let is_sphere = surface.shape < case.packed.sphere_count;
    let outside = p.cmplt(case.low - case.tolerance).any() || p.cmpgt(case.high + case.tolerance).any();
    let within = |k: usize| {
        let (away, depth) = (p - Vec3::from(case.packed.shapes[k].anchor), case.packed.shapes[k].extent);
        away.dot(away) < (depth - case.tolerance).max(0.0).powi(2)
    };
    let own = from.is_some_and(|face| face / 2 == surface.shape && (face % 2 == 0 || !is_sphere));
    match () {
        () if own => Some(2),
        () if outside => Some(3),
        () if is_sphere && surface.side < 0.0 || (0..case.packed.sphere_count).any(within) => Some(4),
        () => None,
    }
}

/// Planes as they are often written.
fn with_epsilon(scene: &SceneTables, origin: Vec3, direction: Vec3, from: Option<usize>) -> Option<Hit> {
    let mut closest: Option<Hit> = None;
    for (shape, record) in scene.shapes.iter().enumerate() {
        let anchor = Vec3::from(record.anchor);
        let is_sphere = shape < scene.sphere_count;
        let t = match is_sphere {
            true => {
                let on = from.is_some_and(|face| face / 2 == shape);
                hit_sphere(origin, direction, anchor, record.extent, on, Sides::Both { behind: false })
            }
            false => (record.extent - anchor.dot(origin)) / anchor.dot(direction),
        };
        let least = if is_sphere { 0.0 } else { 1e-3 };
        if t > least && t < INFINITE && closest.is_none_or(|hit| t < hit.t) {
            closest = Some(Hit { t, shape, from });
        }
    }
    closest
}
