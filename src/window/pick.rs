//! Taking hold of lights and shapes in the picture. No window in here, only rays.

use glam::DVec3;

use super::orbit::axes;
use crate::scene::{Camera, Scene};

/// A light is a point; the hand may miss it by so many heights of the picture.
const REACH: f64 = 0.025;

/// What can be moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thing {
    /// Index into the scene's lights.
    Light(usize),
    /// Index into the scene's shapes.
    Shape(usize),
}

impl Thing {
    /// Where it is, and how large; none if it is no longer there, or cannot be taken.
    pub fn bounds(self, scene: &Scene) -> Option<(DVec3, f64)> {
        match self {
            Thing::Light(i) => scene.lights.iter().nth(i).map(|light| (light.origin(), 0.0)),
            Thing::Shape(i) => scene.shapes.get(i)?.bounds(),
        }
    }

    /// Puts its centre elsewhere.
    pub fn put(self, scene: &mut Scene, center: DVec3) {
        let Some((from, _)) = self.bounds(scene) else { return };
        match self {
            Thing::Light(i) => scene.lights.get_mut(i).into_iter().for_each(|light| light.place(1.0, center - from)),
            Thing::Shape(i) => scene.shapes.get_mut(i).into_iter().for_each(|shape| shape.place(1.0, center - from)),
        }
    }
}

/// A place in the picture, from its top left corner, in units of its width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// 0 left to 1 right.
    pub x: f64,
    /// 0 top to 1 bottom.
    pub y: f64,
    /// Width over height.
    pub aspect: f64,
}

impl Place {
    /// Unit direction of the camera's ray there.
    pub fn direction(self, camera: &Camera) -> DVec3 {
        let [right, up, forward] = axes(camera);
        let half = (camera.fov_y.to_radians() / 2.0).tan();
        let across = (2.0 * self.x - 1.0) * half * self.aspect;
        (forward + right * across + up * ((1.0 - 2.0 * self.y) * half)).normalize()
    }
}

/// Where a point appears, in units of width and height, and how far in front; `None` behind the camera.
pub fn project(camera: &Camera, aspect: f64, point: DVec3) -> Option<(f64, f64, f64)> {
    let [right, up, forward] = axes(camera);
    let away = point - camera.position;
    let depth = away.dot(forward);
    // Nearer than this, what is at the picture's edge leaves every number's range.
    if depth <= 1e-9 * away.length() || depth <= 0.0 {
        return None;
    }
    let half = (camera.fov_y.to_radians() / 2.0).tan();
    let x = away.dot(right) / (depth * half * aspect);
    let y = away.dot(up) / (depth * half);
    Some(((x + 1.0) / 2.0, (1.0 - y) / 2.0, depth))
}

/// Something held by the mouse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// The light or sphere that moves with the mouse.
    pub thing: Thing,
    /// From the point that the hand took to the thing's centre.
    offset: DVec3,
    /// The plane that it moves in: through the point taken, facing the camera.
    depth: f64,
}

/// The nearest light or shape at a place. Lights win: they are small, and drawn over all.
pub fn pick(scene: &Scene, place: Place) -> Option<Held> {
    let camera = &scene.camera;
    let [.., forward] = axes(camera);
    let direction = place.direction(camera);
    let near_light = |(index, position): (usize, DVec3)| {
        let (x, y, depth) = project(camera, place.aspect, position)?;
        let apart = ((x - place.x) * place.aspect).hypot(y - place.y);
        (apart <= REACH).then_some((apart, index, position, depth))
    };
    let lights = scene.lights.iter().map(|light| light.origin()).enumerate().filter_map(near_light);
    if let Some((_, index, position, depth)) = lights.min_by(|a, b| a.0.total_cmp(&b.0)) {
        let taken = camera.position + direction * (depth / direction.dot(forward));
        return Some(Held { thing: Thing::Light(index), offset: position - taken, depth });
    }
    let shapes = scene.shapes.iter().enumerate();
    let hits = shapes.filter_map(|(i, shape)| Some((shape.distance(camera.position, direction, false)?, i, shape)));
    let (t, index, shape) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    // What cannot be taken hides what is behind it.
    let (center, _) = shape.bounds()?;
    let taken = camera.position + direction * t;
    let depth = (taken - camera.position).dot(forward);
    Some(Held { thing: Thing::Shape(index), offset: center - taken, depth })
}

impl Held {
    /// Where the thing's centre is when the mouse is at a place.
    pub fn center(&self, camera: &Camera, place: Place) -> DVec3 {
        let [.., forward] = axes(camera);
        let direction = place.direction(camera);
        camera.position + direction * (self.depth / direction.dot(forward)) + self.offset
    }
}

/// Centre and radius of what F looks at: what was held last, else the middle of all shapes that have an end.
pub fn focus_of(scene: &Scene, thing: Option<Thing>) -> (DVec3, f64) {
    match thing.and_then(|thing| Some((thing, thing.bounds(scene)?))) {
        Some((Thing::Shape(_), bounds)) => bounds,
        Some((Thing::Light(_), (center, _))) => (center, 0.1 * center.distance(scene.camera.position).max(1e-6)),
        None => {
            let points: Vec<(DVec3, f64)> = scene.shapes.iter().filter_map(|shape| shape.bounds()).collect();
            if points.is_empty() {
                let distance = (scene.camera.look_at - scene.camera.position).length();
                return (scene.camera.look_at, distance / 4.0);
            }
            let center = points.iter().map(|(center, _)| *center).sum::<DVec3>() / points.len() as f64;
            (center, points.iter().map(|(c, r)| (*c - center).length() + r).fold(0.0, f64::max))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;
    use crate::shapes::Quad;
    use proptest::prelude::*;

    fn room() -> Scene {
        let text = "[camera]\nposition = [1, 2, 9]\nlook_at = [0, 0.5, 0]\nfov_y = 50\n\
                    [materials.m]\ncolor = [1, 1, 1]\n\
                    [[lights]]\nposition = [2, 3, 1]\nintensity = [1, 1, 1]\n\
                    [[spheres]]\ncenter = [0, 1, -1]\nradius = 1\nmaterial = \"m\"\n\
                    [[spheres]]\ncenter = [0.3, 1, -4]\nradius = 2\nmaterial = \"m\"\n\
                    [[planes]]\nnormal = [0, 1, 0]\noffset = -1\nmaterial = \"m\"\n";
        scene::parse(text, "room.toml").unwrap()
    }

    fn at(scene: &Scene, point: DVec3) -> Place {
        let (x, y, _) = project(&scene.camera, 1.5, point).unwrap();
        Place { x, y, aspect: 1.5 }
    }

    proptest! {
        #[test]
        fn rays_and_projection_are_inverse(x in 0.0..1.0f64, y in 0.0..1.0f64, t in 0.1..100.0f64) {
            let camera = room().camera;
            let place = Place { x, y, aspect: 1.5 };
            let point = camera.position + place.direction(&camera) * t;
            let (px, py, depth) = project(&camera, 1.5, point).unwrap();
            prop_assert!((px - x).abs() < 1e-9 && (py - y).abs() < 1e-9 && depth > 0.0);
        }

        #[test]
        fn what_is_dragged_stays_in_its_plane_and_under_the_mouse(x in 0.1..0.9f64, y in 0.1..0.9f64) {
            let scene = room();
            let from = at(&scene, scene.shapes.spheres[0].center);
            let held = pick(&scene, from).unwrap();
            prop_assert_eq!(held.thing, Thing::Shape(0), "the nearer of the two");
            let [.., forward] = axes(&scene.camera);
            let place = Place { x, y, aspect: 1.5 };
            let center = held.center(&scene.camera, place);
            let depth = |p: DVec3| (p - scene.camera.position).dot(forward);
            prop_assert!((depth(center) - depth(scene.shapes.spheres[0].center)).abs() < 1e-9);
            let (px, py, _) = project(&scene.camera, 1.5, center - held.offset).unwrap();
            prop_assert!((px - x).abs() < 1e-9 && (py - y).abs() < 1e-9);
            // Back where it was taken, the sphere is where it was.
            prop_assert!((held.center(&scene.camera, from) - scene.shapes.spheres[0].center).length() < 1e-9);
        }
    }

    #[test]
    fn lights_are_taken_nearby_and_nothing_where_nothing_is() {
        let scene = room();
        let mut place = at(&scene, scene.lights.points[0].position);
        place.x += 0.9 * REACH / 1.5;
        assert_eq!(pick(&scene, place).unwrap().thing, Thing::Light(0));
        place.x += 0.2 * REACH / 1.5;
        assert_eq!(pick(&scene, place), None);
        assert_eq!(project(&scene.camera, 1.5, DVec3::new(2.0, 3.5, 20.0)), None, "behind");
    }

    #[test]
    fn a_quad_is_taken_where_it_is_and_moves_by_its_corner() {
        let mut scene = room();
        let (corner, edges) = (DVec3::new(-1.0, -0.5, 4.0), [DVec3::new(1.5, 0.2, 0.0), DVec3::new(0.3, 1.0, 0.4)]);
        scene.shapes.quads = vec![Quad { corner, edges, material: 0 }];
        let number = scene.shapes.len() - 1;
        let at = |point: DVec3| {
            let (x, y, _) = project(&scene.camera, 1.5, point).unwrap();
            Place { x, y, aspect: 1.5 }
        };
        // In a corner of it, and beside that corner.
        let inside = at(corner + edges[0] * 0.02 + edges[1] * 0.02);
        assert_eq!(pick(&scene, inside).map(|held| held.thing), Some(Thing::Shape(number)));
        assert_ne!(
            pick(&scene, at(corner - edges[0] * 0.02 - edges[1] * 0.02)).map(|held| held.thing),
            Some(Thing::Shape(number))
        );
        let held = pick(&scene, inside).unwrap();
        let camera = scene.camera.clone();
        let [from, to] = [inside, Place { x: inside.x + 0.1, y: inside.y - 0.05, ..inside }];
        let by = held.center(&camera, to) - held.center(&camera, from);
        assert!(by.length() > 0.1);
        held.thing.put(&mut scene, held.center(&camera, to));
        let quad = &scene.shapes.quads[0];
        assert!(quad.corner.distance(corner + by) < 1e-9, "{} for {}", quad.corner, corner + by);
        assert_eq!(quad.edges, edges);
    }

    #[test]
    fn planes_hide_spheres() {
        let mut scene = room();
        let place = at(&scene, scene.shapes.spheres[0].center);
        scene.shapes.planes[0].offset = 1.5; // between camera and sphere
        assert_eq!(pick(&scene, place), None);
    }
}
