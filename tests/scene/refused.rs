//! Every kind of bad input, each with the place and the words that its error must have.
//!
//! The tests that are tables in all but syntax are kept from rustfmt, which would give each column its own line.

use super::GOOD;
use photile::scene::{MAX_FILE_BYTES, Position, load, parse, parse_bytes};

/// Replaces `from` by `to` in the good scene and expects an error at `line:column` that holds all of `parts`.
#[track_caller]
fn refuses(from: &str, to: &str, line: usize, column: usize, parts: &[&str]) {
    assert!(GOOD.contains(from), "{from:?} is not in the good scene");
    refuses_text(&GOOD.replacen(from, to, 1), line, column, parts);
}

#[track_caller]
fn refuses_text(text: &str, line: usize, column: usize, parts: &[&str]) {
    let message = match parse(text, "scenes/x.toml") {
        Ok(_) => panic!("accepted, but {parts:?} should be wrong in:\n{text}"),
        Err(error) => error.to_string(),
    };
    let place = format!("scenes/x.toml:{line}:{column}: found ");
    assert!(message.starts_with(&place), "{message}\nis not at {line}:{column}");
    assert!(message.contains(", expected "), "{message}");
    for part in parts {
        assert!(message.contains(part), "{message}\ndoes not say {part:?}");
    }
}

#[test]
fn message_reads_as_documented() {
    let error = parse(&GOOD.replace("radius = 1.0", "radius = -1.0"), "scenes/x.toml").unwrap_err();
    let expected = "scenes/x.toml:23:10: found radius = -1.0, expected a radius > 0 (in metres, 1e-15 to 1e15)";
    assert_eq!(error.to_string(), expected);
}

#[test]
#[rustfmt::skip]
fn unknown_and_duplicate_keys() {
    refuses("radius = 1.0", "radus = 1.0", 23, 1, &["unknown key `radus` in [[spheres]]", "(did you mean `radius`?)"]);
    refuses("center =", "centre =", 22, 1, &["did you mean `center`"]);
    refuses("color =", "colour =", 9, 1, &["in [materials.white]", "did you mean `color`"]);
    refuses("[[lights]]", "[[light]]", 17, 3, &["unknown key `light`", "did you mean `lights`"]);
    refuses("passes = 4", "samples = 4", 37, 1, &["in [render]", "expected one of size, photons"]);
    refuses("fov_y = 53.13", "\"f\\u006Fv\" = 1", 6, 1, &["unknown key `\"f\\u006Fv\"`"]);
    refuses("intensity = [10, 20, 30]", "intensity = [1, 1, 1]\nflux = 2\nzz = 1", 20, 1, &["unknown key `flux`"]);
    refuses("radius = 1.0", "radius = 1.0\nradius = 2.0", 24, 1, &["`radius` a second time", "once"]);
    refuses("[[lights]]", "[camera]\n[[lights]]", 17, 2, &["`camera` a second time"]);
    refuses("[[lights]]", "[materials.white]\n[[lights]]", 17, 12, &["`white` a second time"]);
    let inline = "camera = { position = [0,0,1], look_at = [0,0,0], tilt = 1 }";
    refuses_text(inline, 1, 51, &["unknown key `tilt` in [camera]"]);
    // Two unknown keys: the file's first, not the alphabet's.
    refuses("fov_y = 53.13", "zoom = 1\naperture = 2", 6, 1, &["unknown key `zoom`"]);
}

#[test]
#[rustfmt::skip]
fn wrong_types() {
    refuses("radius = 1.0", "radius = \"1.0\"", 23, 10, &["radius = \"1.0\" (a string)", "a radius > 0"]);
    refuses("fov_y = 53.13", "fov_y = true", 6, 9, &["fov_y = true (a boolean)", "degrees"]);
    refuses("offset = -1", "offset = 1979-05-27", 28, 10, &["(a date or time)"]);
    refuses("material = \"white\"", "material = 1", 24, 12, &["material = 1 (an integer)", "name in quotes"]);
    refuses("center = [0, 1, 0]", "center = 1.5", 22, 10, &["(a number with a fraction)", "[x, y, z]"]);
    refuses("center = [0, 1, 0]", "center = [0, \"y\", 0]", 22, 14, &["center[1] = \"y\" (a string)"]);
    refuses("center = [0, 1, 0]", "center = { x = 1 }", 22, 10, &["center as a table"]);
    refuses("center = [0, 1, 0]", "center = [0, [1], 0]", 22, 14, &["center[1] = [1], expected a coordinate"]);
    refuses("[camera]", "[[camera]]", 2, 1, &["camera as an array of tables", "a table [camera]"]);
    refuses("[[spheres]]", "[spheres]", 21, 1, &["spheres as a table", "[[spheres]]"]);
    refuses("[[spheres]]", "[spheres.ball]", 21, 2, &["spheres as a table"]);
    refuses("[materials.white]", "[[materials]]", 8, 1, &["materials as an array of tables", "[materials.NAME]"]);
    refuses("[materials.white]", "[materials]", 9, 9, &["color", "[materials.color]"]);
    refuses_text("camera = 3", 1, 10, &["camera = 3 (an integer)", "a table [camera]"]);
    refuses_text(
        "lights = [1]\n[camera]\nposition=[0,0,0]\nlook_at=[0,0,1]",
        1,
        11,
        &["lights[0] = 1 (an integer)", "[[lights]]"],
    );
}

#[test]
#[rustfmt::skip]
fn arrays_of_wrong_length() {
    refuses("position = [0, 1, 5]", "position = [0, 1]", 3, 12, &["position = [0, 1] (2 values)", "three numbers"]);
    refuses("color = [0.9, 0.9, 0.8]", "color = [1, 1, 1, 1]", 9, 9, &["(4 values)", "[r, g, b]"]);
    refuses("color = [0.9, 0.9, 0.8]", "color = []", 9, 9, &["color = [] (0 values)"]);
    refuses("size = [640, 480]", "size = [640]", 32, 8, &["(1 value)", "[width, height]"]);
}

#[test]
#[rustfmt::skip]
fn numbers_that_are_none_or_do_not_fit_float32() {
    refuses("radius = 1.0", "radius = nan", 23, 10, &["radius = nan", "a radius > 0"]);
    refuses("radius = 1.0", "radius = inf", 23, 10, &["radius = inf"]);
    refuses("center = [0, 1, 0]", "center = [0, 1, -inf]", 22, 17, &["center[2] = -inf", "-1e15 and 1e15"]);
    refuses("up = [0, 1, 0]", "up = [+nan, 1, 0]", 5, 7, &["up[0] = +nan"]);
    refuses("intensity = [10", "intensity = [nan", 19, 14, &["intensity[0] = nan"]);
    refuses("ambient = 0.0", "ambient = inf", 15, 11, &["ambient = inf"]);
    refuses("exposure = -1.5", "exposure = nan", 38, 12, &["exposure = nan"]);
    // Too large for a double, written as a float and as an integer.
    refuses("radius = 1.0", "radius = 1e999", 23, 10, &["radius = 1e999"]);
    let googol = format!("offset = 1{}", "0".repeat(400));
    refuses("offset = -1", &googol, 28, 10, &["offset = 1000", "…"]);
    refuses("photons = 200_000", "photons = 99999999999999999999", 33, 11, &["whole number of photons"]);
    // Fit a double, but overflow or vanish in float32.
    refuses("center = [0, 1, 0]", "center = [1e16, 1, 0]", 22, 11, &["center[0] = 1e16"]);
    refuses("radius = 1.0", "radius = 1e-20", 23, 10, &["1e-15 to 1e15"]);
    refuses("intensity = [10", "intensity = [1.1e30", 19, 14, &["from 0 to 1e30"]);
    refuses("offset = -1", "offset = 1e16", 28, 10, &["offset = 1e16"]);
    let close = "normal = [0, 1e-14, 0]\noffset = 100";
    refuses("normal = [0, 2, 0]\noffset = -1", close, 28, 10, &["1e15 m of the origin", "normal = [0, 1e-14, 0]"]);
}

#[test]
#[rustfmt::skip]
fn camera() {
    refuses("position = [0, 1, 5]\n", "", 2, 1, &["[camera] without position", "position = [x, y, z]"]);
    refuses("look_at = [0, 0, 0]\n", "", 2, 1, &["[camera] without look_at"]);
    refuses("look_at = [0, 0, 0]", "look_at = [0, 1, 5]", 4, 11, &["position [0, 1, 5]"]);
    // Equal but for rounding, where f64 has no digit of the direction left.
    let rounding = "position = [1e9, 1, 5]\nlook_at = [1000000000.0000001, 1, 5]";
    refuses("position = [0, 1, 5]\nlook_at = [0, 0, 0]", rounding, 4, 11, &["a point other than"]);
    refuses("up = [0, 1, 0]", "up = [0, 0, 0]", 5, 6, &["up = [0, 0, 0]", "not all zeros"]);
    refuses("up = [0, 1, 0]", "up = [0, -0.2, -1]", 5, 6, &["not parallel to the view [0, -1, -5]"]);
    refuses("up = [0, 1, 0]", "up = [0, 0.2, 1]", 5, 6, &["not parallel to the view"]);
    let down = "position = [0, 9, 0]\nlook_at = [0, 0, 0]\n#";
    refuses("position = [0, 1, 5]\nlook_at = [0, 0, 0]\n", down, 4, 11, &["default up", "not parallel"]);
    for fov in ["0", "180", "-45.0", "360", "0.0", "-0.0"] {
        refuses("53.13", fov, 6, 9, &[&format!("fov_y = {fov}"), "more than 0 and less than 180"]);
    }
    refuses_text("[render]\npasses = 1\n", 1, 1, &["without camera", "[camera]"]);
    refuses_text("# nothing but a comment\n", 1, 1, &["without camera"]);
}

#[test]
#[rustfmt::skip]
fn materials() {
    refuses("color = [0.9, 0.9, 0.8]", "color = [0.9, 1.01, 0.8]", 9, 15, &["color[1] = 1.01", "from 0 to 1"]);
    refuses("color = [0.9, 0.9, 0.8]", "color = [-0.1, 0, 0]", 9, 10, &["color[0] = -0.1"]);
    refuses("color = [0.9, 0.9, 0.8]\n", "", 8, 1, &["[materials.white] without color"]);
    refuses("diffuse = 0.5", "diffuse = -0.5", 10, 11, &["a share from 0 to 1"]);
    refuses("specular = 0.25", "specular = 1.5", 11, 12, &["a share from 0 to 1"]);
    refuses("transmission = 0.0", "transmission = 2", 13, 16, &["a share from 0 to 1"]);
    refuses("roughness = 0.2", "roughness = 1.2", 12, 13, &["0.001 to 1"]);
    refuses("roughness = 0.2", "roughness = 1e-4", 12, 13, &["0.001 to 1, or 0"]);
    refuses("ior = 1.5", "ior = 0.9", 14, 7, &["index of refraction from 1"]);
    refuses("ambient = 0.0", "ambient = -1", 15, 11, &["ambient radiance"]);
    refuses("diffuse = 0.5", "diffuse = 0.9", 13, 16, &["diffuse = 0.9, specular = 0.25, transmission = 0.0", "at most 1"]);
    let sum = "specular = 0.7\nroughness = 0.5\ntransmission = 0.5";
    let text = GOOD.replace("diffuse = 0.5\n", "");
    let text = text.replace("specular = 0.25\nroughness = 0.2\ntransmission = 0.0", sum);
    refuses_text(&text, 12, 16, &["specular = 0.7, transmission = 0.5", "at most 1"]);
}

#[test]
fn unknown_materials() {
    refuses(
        "material = \"white\"",
        "material = \"whit\"",
        24,
        12,
        &["one of the materials white", "did you mean `white`"],
    );
    refuses("\"white\"\n\n[render]", "\"granite\"\n\n[render]", 29, 12, &["material = \"granite\", expected"]);
    let camera = "[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n";
    let sphere = "[[spheres]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"red\"\n";
    refuses_text(&format!("{camera}{sphere}"), 7, 12, &["which has none: add [materials.red]"]);
    let many: String = (0..1000).map(|i| format!("[materials.m{i}]\ncolor = [0, 0, 0]\n")).collect();
    refuses_text(&format!("{camera}{many}{sphere}"), 2007, 12, &["one of the file's 1000 materials"]);
}

#[test]
#[rustfmt::skip]
fn lights_spheres_and_planes() {
    refuses("intensity = [10, 20, 30]", "intensity = [10, -20, 30]", 19, 18, &["intensity[1] = -20", "W/sr from 0"]);
    refuses("intensity = [10, 20, 30]\n", "", 17, 1, &["[[lights]] without intensity"]);
    refuses("[[lights]]\n", "[[lights]]\nkind = \"pint\"\n", 18, 8, &["kind = \"pint\"", "\"point\"", "did you mean"]);
    refuses("radius = 1.0", "radius = 0", 23, 10, &["radius = 0,", "a radius > 0"]);
    refuses("radius = 1.0\n", "", 21, 1, &["[[spheres]] without radius"]);
    refuses("normal = [0, 2, 0]", "normal = [0, 0.0, -0.0]", 27, 10, &["normal = [0, 0.0, -0.0]", "not all zeros"]);
    refuses("offset = -1\n", "", 26, 1, &["[[planes]] without offset"]);
    // Of two spheres, the second is the wrong one.
    let two = "[[spheres]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"white\"\n[[spheres]]\n";
    refuses("[[spheres]]\ncenter = [0, 1, 0]\n", two, 25, 1, &["[[spheres]] without center"]);
}

#[test]
#[rustfmt::skip]
fn render_defaults() {
    refuses("size = [640, 480]", "size = [640, 0]", 32, 14, &["size[1] = 0", "1 to 65536"]);
    refuses("size = [640, 480]", "size = [65537, 480]", 32, 9, &["size[0] = 65537"]);
    refuses("size = [640, 480]", "size = [640.0, 480]", 32, 9, &["(a number with a fraction)"]);
    refuses("size = [640, 480]", "size = \"640x480\"", 32, 8, &["[width, height]"]);
    refuses("photons = 200_000", "photons = 0", 33, 11, &["photons > 0"]);
    refuses("photons = 200_000", "photons = -5", 33, 11, &["photons = -5"]);
    refuses("radius = 0.25", "radius = 0.0", 34, 10, &["a radius > 0"]);
    refuses("\"tiled-grid\"", "\"tiledgrid\"", 35, 10, &["\"knn\"", "did you mean `tiled-grid`"]);
    refuses("\"hybrid\"", "\"both\"", 36, 9, &["one of \"hybrid\", \"photons\", \"direct\""]);
    refuses("passes = 4", "passes = 4294967296", 37, 10, &["passes > 0"]);
    refuses("exposure = -1.5", "exposure = 121", 38, 12, &["-120 to 120"]);
}

#[test]
#[rustfmt::skip]
fn not_supported_yet() {
    refuses("roughness = 0.2", "roughness = 0", 11, 12, &["specular = 0.25 with roughness 0", "perfect mirrors"]);
    refuses("roughness = 0.2\n", "", 11, 12, &["perfect mirrors are not supported yet"]);
    refuses("transmission = 0.0", "transmission = 0.25", 13, 16, &["glass is not supported yet"]);
}

#[test]
#[rustfmt::skip]
fn toml_syntax() {
    refuses("radius = 1.0", "radius = ", 23, 10, &["found the end of the line, expected a number"]);
    refuses("radius = 1.0", "radius 1.0", 23, 8, &["expected"]);
    refuses("[camera]", "[camera", 2, 8, &["the end of the line", "unclosed table"]);
    refuses("\"white\"\n\n[[planes]]", "white\n\n[[planes]]", 24, 12, &["found `white`, expected a number, a \"string\" in quotes"]);
    refuses("center = [0, 1, 0]", "center = [0, 1, 0", 23, 1, &["expected"]);
    refuses("radius = 1.0", "radius = 1.0.0", 23, 13, &["`.0`"]);
    refuses("# one", "# \u{1}one", 1, 3, &["expected"]);
    // Columns count characters: the key before the fault holds three bytes in two.
    refuses("[materials.white]", "[materials.\"hü\"] x", 8, 18, &["`x`"]);
    // Nested far deeper than a stack is: refused, not overflowed.
    let deep = format!("a = {}", "[".repeat(200_000));
    assert!(parse(&deep, "x").is_err());
    let deep = format!("a = {}", "{a=".repeat(200_000));
    assert!(parse(&deep, "x").is_err());
    let deep = format!("a{} = 1", ".a".repeat(200_000));
    assert!(parse(&deep, "x").is_err());
}

#[test]
fn empty_text() {
    for text in ["", "\u{feff}", " \n\t\r\n"] {
        refuses_text(text, 1, 1, &["an empty file", "[camera]"]);
    }
}

#[test]
fn bytes_that_are_not_utf8() {
    let error = parse_bytes(b"# ok\n# \xC3\xBC \xFF", "x.toml").unwrap_err().to_string();
    assert!(error.starts_with("x.toml:2:5: found byte 0xFF at offset 10"), "{error}");
    // A character cut off at the end of the file.
    let error = parse_bytes(b"# ok\n\xE2\x82", "x.toml").unwrap_err().to_string();
    assert!(error.starts_with("x.toml:2:1: found byte 0xE2 at offset 5"), "{error}");
    let utf16: Vec<u8> = "\u{feff}[camera]".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let error = parse_bytes(&utf16, "x.toml").unwrap_err().to_string();
    assert!(error.contains("looks like UTF-16"), "{error}");
}

#[test]
fn files_that_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.toml");
    let message = |path: &std::path::Path| {
        let error = load(path).unwrap_err();
        assert_eq!(error.position, None);
        error.to_string()
    };
    let missing = message(&path);
    assert!(missing.starts_with(&format!("{}: found ", path.display())), "{missing}");
    assert!(message(folder.path()).contains("found a directory, expected a scene file"));

    // 200 MB that take no disk and, if they were read, a noticeable time.
    std::fs::File::create(&path).unwrap().set_len(200_000_000).unwrap();
    assert!(message(&path).contains("found 190 MiB, expected a scene of at most 64 MiB"));
    std::fs::File::create(&path).unwrap().set_len(MAX_FILE_BYTES + 1).unwrap();
    assert!(message(&path).contains("at most 64 MiB"));
}

/// A device file says that it is empty and never ends.
#[cfg(unix)]
#[test]
fn endless_files_are_refused() {
    let error = load("/dev/zero".as_ref()).unwrap_err().to_string();
    assert!(error.contains("more than 64 MiB"), "{error}");
}

#[test]
fn a_loaded_file_carries_its_path_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.toml");
    std::fs::write(&path, GOOD.replace("radius = 1.0", "radius = -1.0")).unwrap();
    let error = load(&path).unwrap_err();
    assert_eq!(error.file, path.display().to_string());
    assert_eq!(error.position, Some(Position { line: 23, column: 10 }));
    assert_eq!(photile::error::Error::from(error).exit_code(), 2);
}
