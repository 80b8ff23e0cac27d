//! What fills rows that a picture lacks when its time is over.

use photile::device::gl::{Headless, Mean};
use photile::film::Image;

use crate::common;

/// Rows of a picture, by their numbers; columns alike.
fn picture(height: u32, value: impl Fn(u32) -> f32) -> Image {
    let row = |y| vec![[value(y), 2.0 * value(y), 0.0]; 5];
    Image::from_pixels(5, height, (0..height).flat_map(row).collect()).unwrap()
}

/// The picture after its gaps were filled by the rows around them.
fn bridged(image: &Image, gaps: &[[u32; 2]]) -> Option<Vec<f32>> {
    common::one_at_a_time();
    let headless = Headless::new().map_err(|error| common::missing("OpenGL", &error)).ok()?;
    let mut mean = Mean::new(&headless.current().gl).unwrap();
    mean.add_image(image).unwrap();
    mean.bridge(None, gaps).unwrap();
    let filled = mean.read().unwrap();
    drop(mean);
    let rows: Vec<f32> = filled.pixels.chunks(5).map(|row| row[4][0]).collect();
    for (row, pixels) in rows.iter().zip(filled.pixels.chunks(5)) {
        assert!(pixels.iter().all(|pixel| *pixel == [*row, 2.0 * row, 0.0]), "{pixels:?}");
    }
    Some(rows)
}

#[test]
fn gaps_go_over_from_the_row_above_to_the_row_below() {
    // Rows 8 to 24 were not drawn: two bands beside each other, told in any order, and one by itself.
    let gaps = [[16, 24], [8, 16], [32, 40]];
    let is_gap = |y: u32| gaps.iter().any(|[from, to]| (*from..*to).contains(&y));
    let image = picture(48, |y| if is_gap(y) { f32::NAN } else { y as f32 });
    let Some(rows) = bridged(&image, &gaps) else { return };
    for (y, row) in rows.iter().enumerate() {
        assert!((row - y as f32).abs() < 1e-4, "row {y}: {row}");
    }
    // What is there stays, and a gap is not what was there: a picture of steps is filled otherwise.
    let steps = picture(48, |y| f32::from(u8::from(y >= 20)));
    let filled = bridged(&steps, &gaps).unwrap();
    assert_eq!((filled[7], filled[24]), (0.0, 1.0));
    assert!(filled[15] > 0.3 && filled[15] < 0.6, "{}", filled[15]);
}

#[test]
fn gaps_at_an_edge_repeat_the_row_beside_them() {
    let image = picture(24, |y| if (8..16).contains(&y) { y as f32 } else { f32::NAN });
    let Some(rows) = bridged(&image, &[[0, 8], [16, 24]]) else { return };
    assert!(rows[..8].iter().all(|row| *row == 8.0), "{rows:?}");
    assert!(rows[16..].iter().all(|row| *row == 15.0), "{rows:?}");
}
