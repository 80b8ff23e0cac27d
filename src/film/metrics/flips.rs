//! Pixels at a discontinuity of the picture, where two right renderers may see different sides of it.
//!
//! One ray a pixel through the edge of a sphere or of a hard shadow hits or misses by the last bit of a float. Two
//! machines then disagree on that pixel by the whole contrast of the edge, and neither is wrong. Such pixels are
//! counted and bounded by the caller, and left out of the error of all others.

use super::{Mask, Within};
use crate::error::Result;
use crate::film::Image;

/// A neighbour has the same surface's radiance if it lies this many times nearer to a value than the step in question.
const NEARER: f64 = 3.0;
/// How far past its neighbours' range a value may lie, as a share of that range: radiance changes steeply towards
/// a sphere's limb, and the pixel that flips is the outermost. A quarter still tells a black pixel from a mid-gray one.
const BEYOND: f64 = 0.25;
/// The break around the pixel is at least this share of the step that it shall explain.
const BREAK: f64 = 0.5;

/// The pixels in which `a` and `b` each saw another side of an edge that both of them show. A pixel is one if
///
/// 1. its values are apart by more than `tolerance`, say by d in the worst channel;
/// 2. one of its two values is continued in the other image: one of the eight neighbours there lies within d/3 of it;
/// 3. the other value fits its surroundings in the image that lacks it: in each channel it lies in the range of the
///    eight neighbours there, widened by a quarter;
/// 4. in both images the ring of those eight, the pixel itself left out, has a break: along one of the ring's four
///    sides the second difference is at least d/2. A smooth gradient has none, so an error as large as
///    the gradient's step, which its neighbours would explain, is not excused.
///
/// What it cannot tell: beside an edge, an error that looks like either side or like something between them; an edge
/// that is displaced by a pixel along its whole length (every pixel of it is a flip). A wrong renderer makes many of
/// them, so **bound their number**. It is meant for images without noise and with one sample a pixel: noise is full of
/// breaks.
///
/// What it does not excuse: a limb so steep that its outermost pixel is darker than all around it on either side
/// (spheres of a few pixels before a wall of about their own radiance); at the image's border, an edge that crosses no
/// side of the ring inside the image; NaN and infinity.
///
/// # Errors
/// Images of different size.
pub fn flipped_pixels(a: &Image, b: &Image, tolerance: &Within) -> Result<Mask> {
    a.check_same_size(b)?;
    let flipped = |(x, y): (u32, u32)| {
        let (in_a, in_b) = (a.at(x, y), b.at(x, y));
        let step = distance(in_a, in_b);
        if !tolerance.apart(in_a, in_b) || !step.is_finite() {
            return false;
        }
        let continued = |value, other| neighbours(other, x, y).any(|near| distance(near, value) * NEARER <= step);
        let fits = |value, other| fits_range(value, neighbours(other, x, y), tolerance);
        let explained = (continued(in_a, b) && fits(in_b, a)) || (continued(in_b, a) && fits(in_a, b));
        explained && [a, b].into_iter().all(|image| break_in_ring(image, x, y) >= BREAK * step)
    };
    Ok(columns_of_rows(a).map(flipped).collect())
}

/// The pixels with one among their eight neighbours that is not within `contrast` of them: edges of objects and
/// shadows, to be left out where only smooth shading is to be compared.
pub fn edge_pixels(image: &Image, contrast: &Within) -> Mask {
    let edge = |(x, y)| neighbours(image, x, y).any(|near| contrast.apart(near, image.at(x, y)));
    columns_of_rows(image).map(edge).collect()
}

fn columns_of_rows(image: &Image) -> impl Iterator<Item = (u32, u32)> + use<> {
    let width = image.width;
    (0..image.height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}

/// The pixel `dx` columns and `dy` rows away, if the image has it.
fn neighbour(image: &Image, x: u32, y: u32, (dx, dy): (i32, i32)) -> Option<[f32; 3]> {
    let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
    (x < image.width && y < image.height).then(|| image.at(x, y))
}

/// The eight around a pixel, fewer at the image's border.
fn neighbours(image: &Image, x: u32, y: u32) -> impl Iterator<Item = [f32; 3]> + '_ {
    const RING: [(i32, i32); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    RING.into_iter().filter_map(move |offset| neighbour(image, x, y, offset))
}

/// Whether each channel of a value lies in the widened range of some others.
fn fits_range(value: [f32; 3], others: impl Iterator<Item = [f32; 3]>, tolerance: &Within) -> bool {
    let mut range = [(f64::INFINITY, f64::NEG_INFINITY); 3];
    for other in others {
        for ((low, high), channel) in range.iter_mut().zip(other) {
            (*low, *high) = (low.min(channel.into()), high.max(channel.into()));
        }
    }
    value.iter().zip(range).all(|(&channel, (low, high))| {
        let (channel, slack) = (f64::from(channel), BEYOND * (high - low) + tolerance.abs + tolerance.rel * high.abs());
        low - slack <= channel && channel <= high + slack
    })
}

/// Largest second difference, in any channel, along the four sides of the ring around a pixel: 0 for a linear
/// gradient, the step's height or more where an edge crosses a side.
fn break_in_ring(image: &Image, x: u32, y: u32) -> f64 {
    const SIDES: [[(i32, i32); 3]; 4] = [
        [(-1, -1), (0, -1), (1, -1)],
        [(-1, 1), (0, 1), (1, 1)],
        [(-1, -1), (-1, 0), (-1, 1)],
        [(1, -1), (1, 0), (1, 1)],
    ];
    let bend = |side: [(i32, i32); 3]| {
        let [first, middle, last] = side.map(|offset| neighbour(image, x, y, offset));
        let (first, middle, last) = (first?, middle?, last?);
        let second = |c: usize| f64::from(first[c]) - 2.0 * f64::from(middle[c]) + f64::from(last[c]);
        Some((0..3).map(|c| second(c).abs()).fold(0.0, f64::max))
    };
    SIDES.into_iter().filter_map(bend).fold(0.0, f64::max)
}

/// Largest difference in any channel; NaN or infinite if a value is.
fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    let differences = a.iter().zip(&b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    differences.fold(0.0, |largest, d| if d.is_finite() { d.max(largest) } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Within = Within { abs: 1e-5, rel: 1e-5 };

    /// A disc of varying brightness before a gradient: a sphere's limb before a wall.
    fn limb(x: f64, y: f64) -> [f32; 3] {
        limb_before(0.5, x, y)
    }

    fn limb_before(wall: f64, x: f64, y: f64) -> [f32; 3] {
        // Facing the camera, with light from the camera's side: falls to 0.9 at the limb, steeply.
        let disc = |height: f64| 0.9 + 0.7 * height.sqrt();
        let value = height(x, y).map_or(wall + 0.004 * x - 0.002 * y, disc) as f32;
        [value, 0.5 * value, 0.25 * value]
    }

    /// Square of the sphere's height above its limb, in radii; none beside it.
    fn height(x: f64, y: f64) -> Option<f64> {
        let (dx, dy) = ((x - 16.3) / 10.0, (y - 15.8) / 10.0);
        Some(1.0 - dx * dx - dy * dy).filter(|height| *height > 0.0)
    }

    fn scene() -> Image {
        Image::from_fn(32, 32, |x, y| limb(x.into(), y.into()))
    }

    fn count(mask: &Mask) -> usize {
        mask.iter().filter(|flipped| **flipped).count()
    }

    /// An image, the same with every pixel flipped whose ray sees the other side when moved by 0.05 pixels, and which.
    fn nudged(wall: f64) -> (Image, Image, Mask) {
        let inside = |x: f64, y: f64| height(x, y).is_some();
        let a = Image::from_fn(32, 32, |x, y| limb_before(wall, x.into(), y.into()));
        let mut b = a.clone();
        let mut moved = vec![false; a.pixels.len()];
        for (i, (x, y)) in columns_of_rows(&a).enumerate() {
            let (x, y) = (f64::from(x), f64::from(y));
            if inside(x, y) != inside(x + 0.05, y) {
                b.pixels[i] = limb_before(wall, x + 0.05, y);
                moved[i] = true;
            }
        }
        (a, b, moved)
    }

    #[test]
    fn hits_flipped_at_a_limb_are_found_and_nothing_else_is() {
        // Walls darker than the limb, nearly as bright, and brighter than all of the disc.
        for wall in [0.0, 0.5, 0.85, 2.0] {
            let (a, b, moved) = nudged(wall);
            assert!(count(&moved) >= 2, "the test must flip something");
            assert!(flipped_pixels(&a, &b, &TOLERANCE).unwrap() == moved, "wall {wall}");
            assert!(flipped_pixels(&b, &a, &TOLERANCE).unwrap() == moved, "wall {wall}");
            assert_eq!(count(&flipped_pixels(&a, &a, &TOLERANCE).unwrap()), 0);
        }
    }

    #[test]
    fn a_whole_row_flipped_along_a_straight_shadow_edge_is_found() {
        let shadow =
            |edge: u32| Image::from_fn(16, 16, move |x, y| [if y < edge { 1.0 + 0.01 * x as f32 } else { 0.0 }; 3]);
        let mask = flipped_pixels(&shadow(8), &shadow(9), &TOLERANCE).unwrap();
        assert_eq!(count(&mask), 16);
        assert!((0..16).all(|x| mask[8 * 16 + x]));
        // By two rows: the sides are too far for the ring of one pixel to explain both.
        assert_eq!(count(&flipped_pixels(&shadow(8), &shadow(11), &TOLERANCE).unwrap()), 0);
    }

    #[test]
    fn a_real_error_is_not_a_flip() {
        let a = scene();
        // In the smooth inside and on the smooth wall, of every size: a spike, and one as large as the gradient's step.
        for (x, y) in [(16, 16), (14, 12), (3, 3), (28, 25), (0, 0), (31, 7)] {
            for error in [1e-4f32, 0.002, 0.004, 0.008, 0.05, 1.0, -0.3, f32::INFINITY, f32::NAN] {
                let mut b = a.clone();
                b.pixels[y * 32 + x][0] += error;
                let mask = flipped_pixels(&a, &b, &TOLERANCE).unwrap();
                assert_eq!(count(&mask), 0, "error {error} at ({x}, {y}) was excused");
            }
        }
    }

    #[test]
    fn an_error_at_an_edge_that_neither_side_explains_is_not_a_flip() {
        let a = scene();
        let edges = edge_pixels(&a, &Within { abs: 0.2, rel: 0.0 });
        assert!(count(&edges) > 30);
        for i in (0..edges.len()).filter(|&i| edges[i]) {
            for value in [[0.0, 0.0, 0.0], [3.0, 1.5, 0.75], [f32::NAN, 0.0, 0.0]] {
                let mut b = a.clone();
                b.pixels[i] = value;
                assert_eq!(count(&flipped_pixels(&a, &b, &TOLERANCE).unwrap()), 0, "{value:?} at pixel {i}");
            }
        }
    }

    #[test]
    fn a_wrong_region_is_not_a_flip_inside() {
        let a = scene();
        let mut b = a.clone();
        for (pixel, (x, y)) in b.pixels.iter_mut().zip(columns_of_rows(&a)) {
            if (12..20).contains(&x) && (12..20).contains(&y) {
                pixel[0] *= 1.5;
            }
        }
        assert_eq!(count(&flipped_pixels(&a, &b, &TOLERANCE).unwrap()), 0);
    }

    #[test]
    fn a_shifted_picture_has_more_flips_than_any_bound() {
        let a = scene();
        let b = Image::from_fn(32, 32, |x, y| limb(f64::from(x) + 1.0, f64::from(y)));
        assert!(count(&flipped_pixels(&a, &b, &TOLERANCE).unwrap()) > 10);
    }

    #[test]
    fn edges_are_where_neighbours_differ() {
        let image = Image::from_fn(6, 3, |x, _| [if x < 3 { 1.0 } else { 1.2 }; 3]);
        let row = [false, false, true, true, false, false];
        assert_eq!(edge_pixels(&image, &Within { abs: 0.1, rel: 0.0 }), [row, row, row].concat());
        assert_eq!(count(&edge_pixels(&image, &Within { abs: 0.1, rel: 0.1 })), 0);
    }
}
