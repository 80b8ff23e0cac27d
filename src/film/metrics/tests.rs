use super::*;

const SETTINGS: Settings = Settings { tolerance: Within { abs: 0.1, rel: 0.0 }, exposure: 0.0 };

fn image(pixels: &[[f32; 3]]) -> Image {
    Image::from_pixels(pixels.len() as u32, 1, pixels.to_vec()).unwrap()
}

fn near(found: f64, expected: f64) {
    // 1e-6: the inputs are float32, sums are not.
    assert!((found - expected).abs() <= 1e-6 * expected.abs(), "{found}, expected {expected}");
}

#[test]
fn a_case_worked_by_hand() {
    // Differences 0.3, 0.4 and four times 0.
    let reference = image(&[[1.0, 0.0, 0.0], [0.5, 2.0, 0.25]]);
    let x = image(&[[1.3, 0.0, 0.0], [0.5, 1.6, 0.25]]);
    let found = measure(&x, &reference, &SETTINGS).unwrap();
    near(found.rmse, (0.25f64 / 6.0).sqrt()); // 0.09 + 0.16
    near(found.mae, 0.7 / 6.0);
    near(found.max_abs, 0.4);
    near(found.rel_mse, (0.09 / 1.01 + 0.16 / 4.01) / 6.0);
    near(found.smape, (0.6 / 2.3 + 0.8 / 3.6) / 6.0);
    assert_eq!(found.psnr, f64::INFINITY); // all four lie at or above white
    assert_eq!((found.pixels_over, found.non_finite, found.pixels), (2, 0, 2));
}

#[test]
fn psnr_is_of_what_the_screen_shows() {
    // sRGB: linear 0.214041 is display 0.5, 0.050876 is 0.25: one of three channels is a quarter off.
    let (a, b) = (image(&[[0.214_041, 0.0, 9.0]]), image(&[[0.050_876, -1.0, 5.0]]));
    let found = measure(&a, &b, &SETTINGS).unwrap().psnr;
    assert!((found - -10.0 * (0.0625f64 / 3.0).log10()).abs() < 1e-3, "{found}"); // six digits of the inputs
    // Two stops down everything but white shows, so more of the difference does.
    let darker = Settings { exposure: -4.0, ..SETTINGS };
    let (a, b) = (image(&[[9.0; 3]]), image(&[[5.0; 3]]));
    assert_eq!(measure(&a, &b, &SETTINGS).unwrap().psnr, f64::INFINITY);
    assert!(measure(&a, &b, &darker).unwrap().psnr < 20.0);
}

#[test]
fn every_metric_flags_a_difference_and_none_flags_equality() {
    let reference = Image::from_fn(16, 16, |x, y| [x as f32 / 16.0, y as f32 / 16.0, 0.5]);
    let equal = measure(&reference, &reference, &SETTINGS).unwrap();
    assert_eq!((equal.rmse, equal.mae, equal.max_abs, equal.rel_mse, equal.smape), (0.0, 0.0, 0.0, 0.0, 0.0));
    assert_eq!((equal.psnr, equal.pixels_over, equal.pixels), (f64::INFINITY, 0, 256));

    // One channel of one pixel of 256 is enough.
    let mut x = reference.clone();
    x.pixels[100][1] += 0.25;
    let found = measure(&x, &reference, &SETTINGS).unwrap();
    near(found.rmse, 0.25 / (3.0f64 * 256.0).sqrt());
    near(found.mae, 0.25 / 768.0);
    near(found.max_abs, 0.25);
    assert!(found.rel_mse > 1e-5 && found.smape > 1e-5 && found.psnr < 50.0);
    assert_eq!(found.pixels_over, 1);
}

#[test]
fn rel_mse_and_smape_weigh_by_the_reference() {
    let dark = measure(&image(&[[0.02; 3]]), &image(&[[0.01; 3]]), &SETTINGS).unwrap();
    let bright = measure(&image(&[[10.01; 3]]), &image(&[[10.0; 3]]), &SETTINGS).unwrap();
    near(dark.rel_mse, 1e-4 / 0.0101);
    assert!((bright.rel_mse - 1e-4 / 100.01).abs() < 1e-9); // float32 near 10 has steps of 1e-6
    near(dark.smape, 2.0 / 3.0);
    // SMAPE does not care which is the reference; of opposite signs it is 2, of two zeros 0.
    near(measure(&image(&[[0.01; 3]]), &image(&[[0.02; 3]]), &SETTINGS).unwrap().smape, 2.0 / 3.0);
    near(measure(&image(&[[1.0, 0.0, 1.0]]), &image(&[[0.0, 0.0, 1.0]]), &SETTINGS).unwrap().smape, 2.0 / 3.0);
}

#[test]
fn nan_and_infinity_fail_every_bound() {
    let good = image(&[[1.0; 3], [2.0; 3]]);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let x = image(&[[1.0; 3], [2.0, bad, 2.0]]);
        for (x, reference) in [(&x, &good), (&good, &x), (&x, &x)] {
            let found = measure(x, reference, &SETTINGS).unwrap();
            for metric in [found.rmse, found.mae, found.max_abs, found.rel_mse, found.smape, -found.psnr] {
                assert_eq!(metric, f64::INFINITY);
            }
            assert_eq!((found.pixels_over, found.non_finite), (1, 1));
        }
    }
}

#[test]
fn the_tolerance_is_absolute_plus_relative() {
    let within = Within { abs: 0.5, rel: 0.25 };
    assert!(!within.apart([4.0, 0.0, -4.0], [2.5, 0.5, -2.5])); // 1.5 = 0.5 + 0.25 · 4
    assert!(within.apart([4.0; 3], [4.0, 4.0, 2.4]));
    assert!(within.apart([0.0; 3], [0.0, 0.7, 0.0]));
    assert!(within.apart([f32::INFINITY; 3], [f32::INFINITY; 3]));
}

#[test]
fn excluded_pixels_do_not_count_and_all_others_do() {
    let reference = image(&[[1.0; 3], [2.0; 3], [3.0; 3]]);
    let x = image(&[[1.5; 3], [f32::NAN; 3], [3.25; 3]]);
    let found = measure_except(&x, &reference, &vec![false, true, false], &SETTINGS).unwrap();
    near(found.mae, 0.375);
    assert_eq!((found.pixels, found.pixels_over, found.non_finite), (2, 2, 0));
    assert_eq!(measure_except(&x, &reference, &vec![false; 3], &SETTINGS).unwrap().mae, f64::INFINITY);
    // A mask that excludes everything, or is of another image, is no pass.
    assert!(measure_except(&x, &reference, &vec![true; 3], &SETTINGS).is_err());
    assert!(measure_except(&x, &reference, &vec![false; 2], &SETTINGS).is_err());
}

#[test]
fn images_of_different_size_are_an_error() {
    let (a, b) = (Image::new(4, 3), Image::new(3, 4));
    let error = measure(&a, &b, &SETTINGS).unwrap_err();
    assert_eq!(error.to_string(), "images differ in size: 4x3 and 3x4");
    assert_eq!(error.exit_code(), 2);
    assert!(measure_except(&a, &b, &vec![false; 12], &SETTINGS).is_err());
    assert!(flipped_pixels(&a, &b, &SETTINGS.tolerance).is_err());
}

#[test]
fn sums_do_not_stall() {
    // A million equal errors of 1e-4 beside one of 1e4: in f32 sums of squares the small ones would vanish.
    let reference = Image::new(1000, 1000);
    let mut x = Image::from_fn(1000, 1000, |_, _| [1e-4; 3]);
    x.pixels[0] = [1e4; 3];
    near(measure(&x, &reference, &SETTINGS).unwrap().mae, (1e4 + 999_999.0 * 1e-4) / 1e6);
}
