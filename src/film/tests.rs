use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;

use proptest::prelude::*;

use super::*;

fn gradient(width: u32, height: u32) -> Image {
    Image::from_fn(width, height, |x, y| [x as f32 / width as f32, y as f32 * 0.7, 1e-3 * (x * y) as f32])
}

fn names(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

/// A directory and a path in it.
fn place(name: &str) -> (tempfile::TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join(name);
    (directory, path)
}

#[test]
fn row_0_is_the_top_and_columns_run_first() {
    let image = Image::from_fn(3, 2, |x, y| [x as f32, y as f32, 0.0]);
    assert_eq!(image.pixels[1], [1.0, 0.0, 0.0]);
    assert_eq!(image.pixels[3], [0.0, 1.0, 0.0]);
    assert_eq!(image.at(2, 1), [2.0, 1.0, 0.0]);
}

#[test]
fn the_tone_map_is_srgb_with_exposure_and_a_clamp() {
    let image = Image::from_pixels(1, 2, vec![[0.0, 0.214_5, 1.0], [-3.0, 0.002, 7.0]]).unwrap();
    // 0.2145 is just over sRGB mid-gray (display 0.5005); 0.002 lies on the linear part: 12.92 · 0.002 · 255 = 6.6.
    assert_eq!(image.to_rgb8(0.0), [0, 128, 255, 0, 7, 255]);
    // One stop up: 2 · 0.2145 = 0.429 → 0.6865 · 255 = 175.1; 0.004 is past the linear part: 0.0507 · 255 = 12.9.
    assert_eq!(image.to_rgb8(1.0), [0, 175, 255, 0, 13, 255]);
    assert_eq!(image.to_rgb8(-1.0)[2], 188); // 0.5 → 0.7354 · 255 = 187.5
}

#[test]
fn exr_keeps_every_bit_settings_and_channels() {
    let (_directory, path) = place("a.exr");
    let mut image = gradient(37, 19);
    image.pixels[0] = [-0.0, f32::MIN_POSITIVE / 8.0, f32::MAX];
    let settings = [("scene", "scenes/gi_ref.toml"), ("title", "Ω = 4π\nnext"), ("long", &"x".repeat(5000))];
    let settings = settings.map(|(name, value)| (name.to_owned(), value.to_owned()));
    let channel = Channel { name: "stderr.R".into(), samples: (0..37 * 19).map(|i| i as f32 * 0.1).collect() };
    let options = SaveOptions { exposure: 3.0, settings: &settings, channels: std::slice::from_ref(&channel) };
    image.save(&path, &options).unwrap();

    let file = load_exr(&path).unwrap();
    let bits = |image: &Image| image.pixels.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&file.image), bits(&image));
    assert_eq!(file.channels, std::slice::from_ref(&channel));
    assert_eq!(file.settings[0], settings[0]);
    assert_eq!(file.settings[1], ("title".to_owned(), "Ω = 4π next".to_owned()));
    assert_eq!(file.settings[2], settings[2]);
    assert_eq!(Image::load(&path).unwrap(), image);

    // The same picture is the same file: resumed and uninterrupted renders are compared by bytes.
    let first = fs::read(&path).unwrap();
    image.save(&path, &options).unwrap();
    assert_eq!(fs::read(&path).unwrap(), first);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn png_comes_back_within_half_a_step(radiance in prop::collection::vec(prop::array::uniform3(0f32..1.0), 12)) {
        let (_directory, path) = place("a.PNG");
        let image = Image::from_pixels(4, 3, radiance).unwrap();
        image.save(&path, &SaveOptions::default()).unwrap();
        let back = Image::load(&path).unwrap();
        for (a, b) in image.pixels.iter().flatten().zip(back.pixels.iter().flatten()) {
            // 1e-5 over half a step of 1/255: powf there and back.
            prop_assert!((display_value(*a) - display_value(*b)).abs() <= 0.5 / 255.0 + 1e-5, "{a} came back as {b}");
        }
    }

    #[test]
    fn the_transfer_function_inverts(display in 0f32..=1.0) {
        // 1e-4: the standard's rounded constants leave a step of 3e-8 at the joint, powf a few ulp.
        prop_assert!((display_value(linear_value(display)) - display).abs() < 1e-4);
    }
}

#[test]
fn nan_and_infinity_are_never_written() {
    for (name, bad) in [("a.exr", f32::NAN), ("a.png", f32::INFINITY), ("a.exr", f32::NEG_INFINITY)] {
        let (directory, path) = place(name);
        let mut image = gradient(8, 4);
        image.pixels[11][1] = bad;
        image.pixels[20][2] = bad;
        let error = image.save(&path, &SaveOptions::default()).unwrap_err();
        assert!(error.to_string().contains("2 of 32 pixels"), "{error}");
        assert!(error.to_string().contains("column 3, row 1"), "{error}");
        assert_eq!(error.exit_code(), 1);
        assert_eq!(names(directory.path()), [] as [String; 0]);
        assert_eq!(image.replace_non_finite([1.0, 0.0, 1.0]), 2);
        image.save(&path, &SaveOptions::default()).unwrap();
    }
    let samples = vec![f32::NAN; 32];
    let channels = [Channel { name: "stderr.R".into(), samples }];
    let (directory, path) = place("a.exr");
    let options = SaveOptions { channels: &channels, ..Default::default() };
    let error = gradient(8, 4).save(&path, &options).unwrap_err();
    assert!(error.to_string().contains("'stderr.R': 32 of 32"), "{error}");
    assert_eq!(names(directory.path()), [] as [String; 0]);
}

#[test]
fn channels_of_wrong_name_or_length_are_refused() {
    let (_directory, path) = place("a.exr");
    for (name, length) in [("R", 32), ("", 32), ("Z", 31), ("twice", 32)] {
        let channel = Channel { name: name.into(), samples: vec![0.0; length] };
        let channels = [Channel { name: "twice".into(), samples: vec![0.0; 32] }, channel];
        let options = SaveOptions { channels: &channels, ..Default::default() };
        let error = gradient(8, 4).save(&path, &options).unwrap_err().to_string();
        assert!(error.contains(&format!("'{name}'")), "{error}");
    }
}

#[test]
fn an_output_that_cannot_be_written_is_known_beforehand() {
    let (directory, _) = place("");
    let at = |name: &str| directory.path().join(name);
    fs::write(at("file"), "").unwrap();
    fs::create_dir(at("folder.png")).unwrap();
    let too_long = format!("{}.png", "n".repeat(300));
    for (name, words) in [
        ("a.jpg", "unknown image format .jpg, expected .png or .exr"),
        ("a", "no extension"),
        (".png", "no extension"),
        ("none/a.png", "none: No such file"),
        ("file/a.png", "Not a directory"),
        ("folder.png", "is a directory"),
        (&too_long, "too long"),
    ] {
        let error = check_output(&at(name)).unwrap_err();
        assert!(error.to_string().contains(words), "{error} lacks '{words}'");
        assert_eq!(error.exit_code(), 2, "{error}");
    }
    assert!(check_output(Path::new("/dev/null")).is_err());
    // Root writes where permission bits forbid it; procfs refuses even root.
    let error = check_output(Path::new("/proc/a.png")).unwrap_err();
    assert!(error.to_string().contains("cannot write to directory /proc"), "{error}");

    assert_eq!(check_output(&at("a.png")).unwrap(), Format::Png);
    assert_eq!(check_output(&at("a.EXR")).unwrap(), Format::Exr);
    assert_eq!(check_output(Path::new("a.png")).unwrap(), Format::Png); // the working directory
    let mut left = names(directory.path());
    left.sort();
    assert_eq!(left, ["file", "folder.png"]);
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let (directory, path) = place("a.exr");
    fs::write(&path, "old").unwrap();
    let error = write_beside(&path, |file| {
        std::io::Write::write_all(file, b"half a fi")?;
        Err(std::io::Error::other("disk full"))
    })
    .unwrap_err();
    assert!(error.to_string().contains("a.exr: cannot write: disk full"), "{error}");
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(directory.path()), ["a.exr"]);
}

#[test]
fn a_written_file_is_as_readable_as_any_and_a_link_stays_a_link() {
    let (directory, path) = place("real.png");
    let twin = directory.path().join("twin");
    fs::write(&twin, "").unwrap();
    fs::write(&path, "old").unwrap();
    let link = directory.path().join("link.png");
    std::os::unix::fs::symlink(&path, &link).unwrap();
    gradient(4, 4).save(&link, &SaveOptions::default()).unwrap();
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(Image::load(&path).unwrap().width, 4);
    let mode = |path: &Path| path.metadata().unwrap().permissions().mode();
    assert_eq!(mode(&path), mode(&twin));
}

#[test]
fn broken_images_are_refused_by_name() {
    let (directory, path) = place("whole.exr");
    gradient(5, 4).save(&path, &SaveOptions::default()).unwrap();
    let whole = fs::read(&path).unwrap();
    let broken = directory.path().join("broken.exr");
    let mut huge = whole.clone();
    let window = find(&whole, b"dataWindow\0box2i\0") + 17 + 4;
    huge[window + 8..window + 16].copy_from_slice(&[0xff, 0xff, 0xff, 0x3f, 0xff, 0xff, 0xff, 0x3f]);
    for (bytes, words) in [
        (&b""[..], "empty"),
        (b"P6 4 4 255", "neither a PNG nor an EXR"),
        (&whole[..whole.len() - 7], "broken.exr"),
        (b"\x89PNG\r\n\x1a\nnonsense", "broken.exr"),
        (&huge, "broken.exr"),
    ] {
        fs::write(&broken, bytes).unwrap();
        let error = Image::load(&broken).unwrap_err();
        assert!(error.to_string().contains(words), "{error} lacks '{words}'");
        assert_eq!(error.exit_code(), 2);
    }
    assert_eq!(Image::load(&directory.path().join("none.exr")).unwrap_err().exit_code(), 2);
    assert_eq!(Image::load(directory.path()).unwrap_err().exit_code(), 2);
    // Wherever the file ends, and whatever byte is wrong: an answer, not a panic.
    for i in 0..whole.len() {
        let _ = exr_file::read(&broken, &whole[..i]);
        let mut wrong = whole.clone();
        wrong[i] ^= 0xa5;
        let _ = exr_file::read(&broken, &wrong);
    }
}

fn find(bytes: &[u8], wanted: &[u8]) -> usize {
    bytes.windows(wanted.len()).position(|window| window == wanted).unwrap()
}

#[test]
fn the_heat_map_shows_equal_small_large_and_broken_pixels_apart() {
    let a = Image::new(5, 1);
    let mut b = a.clone();
    b.pixels = vec![[0.0; 3], [0.0, -1e-5, 0.0], [1e-3, 0.0, 1e-5], [0.0, 0.0, 50.0], [f32::NAN, 0.0, 0.0]];
    let map = heat_map(&a, &b).unwrap();
    let luminance = |i: usize| 0.2126 * map.pixels[i][0] + 0.7152 * map.pixels[i][1] + 0.0722 * map.pixels[i][2];
    assert_eq!(map.pixels[0], [0.0; 3]);
    assert!(luminance(0) < luminance(1) && luminance(1) < luminance(2) && luminance(2) < luminance(3));
    assert_eq!(map.pixels[4], [0.0, 1.0, 1.0]);
    assert_eq!(map.non_finite(), 0);
    // Half way up the six decades: the middle entry of matplotlib's table, (0.736, 0.216, 0.330).
    for (channel, table) in map.pixels[2].into_iter().zip([0.736, 0.216, 0.330]) {
        assert!((display_value(channel) - table).abs() < 0.03, "{channel} against {table}");
    }
    assert_eq!(heat_map(&a, &a).unwrap(), a);
    assert!(heat_map(&a, &Image::new(1, 5)).is_err());
}
