//! How large things look, and how much of a surface a tile sees.

use glam::Vec3;

use crate::plan::cells::Bounds;
use crate::rays::camera::camera_direction;
use crate::records::{Frame, PLANE, Shape};

/// How large areas of the image are on the surface at a point.
pub struct Extent {
    /// From the camera to the point, metres.
    pub away: Vec3,
    /// Of the whole image, across and down, at the point's depth; metres.
    image: [f32; 2],
    /// Width and height of the image, pixels.
    pixels: [f32; 2],
    /// Between the view and the surface's normal; slanted surfaces fill more of an area.
    cosine: f32,
}

impl Extent {
    /// Of the surface of `shape` at a point.
    pub fn at(point: Vec3, shape: &Shape, frame: &Frame) -> Extent {
        let away = point - Vec3::from(frame.position);
        let depth = away.dot(frame.forward.into());
        let normal = if shape.kind == PLANE { shape.anchor.into() } else { point - Vec3::from(shape.anchor) };
        let cosine = (away.dot(normal) / (away.length() * normal.length())).abs().max(0.03);
        let image = [frame.right, frame.up].map(|half| 2.0 * Vec3::from(half).length() * depth);
        Extent { away, image, pixels: [frame.width, frame.height], cosine }
    }

    /// Metres across and down that so many pixels are on the surface.
    fn sides(&self, size: [f32; 2]) -> [f32; 2] {
        let [across, down] = [0, 1].map(|axis| self.image[axis] * (size[axis] / self.pixels[axis]).min(1.0));
        [across, down / self.cosine]
    }

    /// Square metres that so many pixels are on the surface, `more` metres added to its width and height.
    pub fn area(&self, size: [f32; 2], more: f32) -> f32 {
        let [across, down] = self.sides(size);
        (across + more) * (down + more)
    }

    /// The radius of a disc with the area of so many pixels on the surface, metres.
    pub fn disc(&self, size: [f32; 2]) -> f32 {
        let [across, down] = self.sides(size);
        (across * down / std::f32::consts::PI).sqrt()
    }
}

/// The pixel that sees what lies in this direction.
pub fn pixel_of(frame: &Frame, away: Vec3) -> [f32; 2] {
    let depth = away.dot(frame.forward.into());
    let [x, y] =
        [frame.right, frame.up].map(|half| away.dot(half.into()) / (depth * Vec3::from(half).length_squared()));
    [0.5 * (1.0 + x) * frame.width, 0.5 * (1.0 - y) * frame.height]
}

/// Square metres of the box of what a pixel's tile sees of a plane, R farther on all sides; nothing stands before it. Where
/// the tile reaches beyond the horizon, as far as its last pixel may see.
pub fn plane_area(plane: &Shape, frame: &Frame, pixel: [f32; 2], tile: [u32; 2], radius: f32) -> f32 {
    let (origin, normal) = (Vec3::from(frame.position), Vec3::from(plane.anchor));
    let height = plane.extent - normal.dot(origin);
    let farthest = height.abs() * frame.height / Vec3::from(frame.up).length();
    let sides = |axis: usize, all: f32| {
        let side = tile[axis] as f32;
        let first = (pixel[axis] / side).floor() * side;
        [first + 0.5, (first + side).min(all) - 0.5]
    };
    let mut bounds = Bounds::EMPTY;
    for x in sides(0, frame.width) {
        for y in sides(1, frame.height) {
            let direction = camera_direction(frame, x, y);
            let distance = height / normal.dot(direction);
            let distance = if distance > 0.0 { distance.min(farthest) } else { farthest };
            bounds.add((origin + direction * distance).to_array());
        }
    }
    let mut extents = [0, 1, 2].map(|axis| bounds.high[axis] - bounds.low[axis] + 2.0 * radius);
    extents.sort_by(f32::total_cmp);
    extents[1] * extents[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_see_as_much_of_a_plane_as_their_corners_do() {
        // A metre above the ground, a pixel a hundredth wide at a distance of 1; the horizon between rows 49 and 50.
        let (width, height) = (200.0, 100.0);
        let (right, up, forward) = ([1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, -1.0]);
        let frame = Frame { right, up, forward, position: [0.0, 1.0, 0.0], width, height, ..Frame::default() };
        let ground = Shape { kind: PLANE, anchor: [0.0, 1.0, 0.0], extent: 0.0, ..Shape::default() };
        let point = Vec3::new(0.35, 0.0, -2.5);
        let pixel = pixel_of(&frame, point - Vec3::from(frame.position));
        assert!((pixel[0] - 114.0).abs() < 1e-3 && (pixel[1] - 90.0).abs() < 1e-3, "{pixel:?}");
        // Pixels' centres of rows 80 to 89 lie 0.305 to 0.395 below the horizon, at distances of 1 / 0.305 and 1 / 0.395.
        let [far, near] = [1.0 / 0.305, 1.0 / 0.395];
        // Columns 110 to 119, 0.105 to 0.195 to the right.
        let expected = (0.195 * far - 0.105 * near + 0.2) * (far - near + 0.2);
        let found = plane_area(&ground, &frame, [114.0, 85.0], [10, 10], 0.1);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} m², {expected} expected");
        // Across the horizon it is as far as the lowest pixel that might see the ground: 200 m.
        let beyond = plane_area(&ground, &frame, [114.0, 55.0], [20, 20], 0.1);
        assert!(beyond > 100.0 * 20.0 && beyond < 400.0 * 100.0, "{beyond} m²");
        assert!(beyond > 100.0 * found);
    }
}
