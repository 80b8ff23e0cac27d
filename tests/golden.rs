//! The reference images in `tests/golden/` are there, whole, and what their README says they are.

use std::path::{Path, PathBuf};

use photile::film::{Image, load_exr};

/// Mean radiance of each full image as its maker stated it, to four digits.
const MEANS: [(&str, [f64; 3]); 4] = [
    ("gi_ref", [1.0290, 1.0094, 0.5586]),
    ("gi_two_lights", [0.5760, 0.7181, 0.2563]),
    ("sphere_and_plane", [0.2663, 0.1995, 0.8926]),
    ("color_bleeding", [0.4609, 0.3602, 0.4074]),
];

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.exr"))
}

fn mean(image: &Image) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pixel in &image.pixels {
        for (sum, channel) in sum.iter_mut().zip(pixel) {
            *sum += f64::from(*channel);
        }
    }
    sum.map(|sum| sum / image.pixels.len() as f64)
}

#[test]
fn every_reference_has_the_stated_mean() {
    for (name, expected) in MEANS {
        // Written by the OpenEXR library itself, so this also checks that our reader understands others' files.
        let file = load_exr(&golden(name)).unwrap();
        assert_eq!((file.image.width, file.image.height, file.image.non_finite()), (320, 240, 0), "{name}");
        assert!(file.channels.is_empty());
        for (found, expected) in mean(&file.image).into_iter().zip(expected) {
            assert!((found - expected).abs() <= 0.6e-4, "{name}: {found}, stated {expected}"); // half a last digit
        }
    }
}

#[test]
fn direct_light_is_a_part_of_all_light() {
    for (name, _) in MEANS {
        let all = Image::load(&golden(name)).unwrap();
        let direct = Image::load(&golden(&format!("{name}_direct"))).unwrap();
        all.check_same_size(&direct).unwrap();
        let [all_mean, direct_mean] = [&all, &direct].map(mean);
        assert!((0..3).all(|c| direct_mean[c] > 0.0 && direct_mean[c] <= all_mean[c]), "{name}");
        // Pixel by pixel but for noise: were an image upside down, its shadows would lie on lit floor.
        let over = all.pixels.iter().zip(&direct.pixels).filter(|(a, d)| (0..3).any(|c| d[c] > 1.02 * a[c] + 0.01));
        assert!(over.count() < 8, "{name}: direct light exceeds all light");
    }
}
