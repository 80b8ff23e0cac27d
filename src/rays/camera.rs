//! Twin of `glsl/shared/camera.glsl`.

use glam::Vec3;

use super::random::{hash_u, hash2_u, owen_scramble, scramble_reversed, sobol_second, unit_real};
use crate::records::Frame;

/// `v / |v|`, with the shaders' order of operations.
pub fn normalize3(v: Vec3) -> Vec3 {
    v * (1.0 / v.dot(v).sqrt())
}

/// Where in its pixel a sample lies, across, in [0, 1).
pub fn jitter_x(index: u32, pixel_key: u32) -> f32 {
    unit_real(scramble_reversed(index, hash_u(pixel_key)).reverse_bits())
}

/// Where in its pixel a sample lies, down, in [0, 1).
pub fn jitter_y(index: u32, pixel_key: u32) -> f32 {
    unit_real(owen_scramble(sobol_second(index), hash_u(pixel_key ^ 0x68bc_21eb)))
}

/// Unit direction through the point (x, y) of the image plane, in pixels from the image's top left corner.
pub fn camera_direction(frame: &Frame, x: f32, y: f32) -> Vec3 {
    let across = x * (2.0 / frame.width) - 1.0;
    let upward = 1.0 - y * (2.0 / frame.height);
    let [right, up, forward] = [frame.right, frame.up, frame.forward].map(Vec3::from);
    normalize3(forward + (right * across + up * upward))
}

/// Unit direction of one of a pixel's samples, counted from the picture's first. `one_sample`: the pixel's centre.
pub fn sample_direction(frame: &Frame, one_sample: bool, column: u32, row: u32, number: u32) -> Vec3 {
    let (x, y, _) = sample_point(frame, one_sample, column, row, number);
    camera_direction(frame, x, y)
}

/// Where that sample lies on the image plane, in pixels from the image's top left corner; and the pixel's key.
pub fn sample_point(frame: &Frame, one_sample: bool, column: u32, row: u32, number: u32) -> (f32, f32, u32) {
    let (x, y) = (column as f32, row as f32);
    let seed = frame.seed_low as u32 | (frame.seed_high as u32) << 16;
    let key = hash2_u(column, row ^ seed);
    if one_sample {
        return (x + 0.5, y + 0.5, key);
    }
    let index = frame.first_sample as u32 + number;
    (x + jitter_x(index, key), y + jitter_y(index, key), key)
}
