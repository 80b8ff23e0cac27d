//! Quads in scene files: what is read, and what is refused where.

use glam::DVec3;
use photile::scene::parse;

use super::quad;

fn text(body: &str) -> String {
    format!(
        "[camera]\nposition = [0, 1, 5]\nlook_at = [0, 0, 0]\n[materials.white]\ncolor = [1, 1, 1]\n[[quads]]\n{body}\n"
    )
}

const CORNER: &str = "corner = [1, 2, 3]";
const EDGES: &str = "edges = [[1, 0, 0], [0.5, 0, -2]]";
const MATERIAL: &str = "material = \"white\"";

#[test]
fn a_quad_is_read_as_written() {
    let scene = parse(&text(&[CORNER, EDGES, MATERIAL].join("\n")), "x.toml").unwrap();
    let [quad] = &scene.shapes.quads[..] else { panic!("{:?}", scene.shapes) };
    assert_eq!(quad.corner, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(quad.edges, [DVec3::X, DVec3::new(0.5, 0.0, -2.0)]);
    assert_eq!(quad.material, 0);
    // edges[0] × edges[1]
    assert!(quad.normal().distance(DVec3::Y) < 1e-12, "{}", quad.normal());
}

#[test]
fn bounds_of_size_are_not_bounds_of_shape() {
    for edges in ["[[1e-10, 0, 0], [0, 1e-10, 0]]", "[[1e6, 0, 0], [0, 1e6, 0]]", "[[1, 0, 0], [1, 1e-3, 0]]"] {
        let body = quad("[0, 0, 0]", edges, "white");
        parse(&text(body.trim_start_matches("[[quads]]\n")), "x.toml").unwrap_or_else(|error| panic!("{error}"));
    }
}

/// Expects an error at a line, which starts at the quad's first key, that holds all of `parts`.
#[track_caller]
fn refuses(body: &[&str], line: usize, parts: &[&str]) {
    let error = parse(&text(&body.join("\n")), "x.toml").map(|_| body).unwrap_err().to_string();
    assert!(error.starts_with(&format!("x.toml:{}:", line + 6)), "{error}\nis not at line {}", line + 6);
    assert!(error.contains("found ") && error.contains(", expected "), "{error}");
    for part in parts {
        assert!(error.contains(part), "{error}\ndoes not say {part:?}");
    }
}

#[test]
fn what_is_no_quad_is_refused_where_it_stands() {
    let directions = "two edges of some length in different directions";
    refuses(&[CORNER, "edges = [[0, 0, 0], [0, 1, 0]]", MATERIAL], 2, &["edges"]);
    refuses(&[CORNER, "edges = [[1, 0, 0], [0, 0, 0]]", MATERIAL], 2, &["edges"]);
    refuses(&[CORNER, "edges = [[1, 2, 3], [2, 4, 6]]", MATERIAL], 2, &[directions]);
    refuses(&[CORNER, "edges = [[1, 2, 3], [-1, -2, -3]]", MATERIAL], 2, &[directions]);
    refuses(&[CORNER, "edges = [[1, 0, 0], [1, 1e-5, 0]]", MATERIAL], 2, &[directions]);
    refuses(&[CORNER, "edges = [[nan, 0, 0], [0, 1, 0]]", MATERIAL], 2, &["nan"]);
    refuses(&[CORNER, "edges = [[inf, 0, 0], [0, 1, 0]]", MATERIAL], 2, &["inf"]);
    refuses(&["corner = [0, nan, 0]", EDGES, MATERIAL], 1, &["nan"]);
    refuses(&["corner = [0, 0]", EDGES, MATERIAL], 1, &["[x, y, z]"]);
    refuses(&[CORNER, "edges = [[1, 0, 0]]", MATERIAL], 2, &["two edges"]);
    refuses(&[CORNER, "edges = [1, 0, 0]", MATERIAL], 2, &["two edges"]);
    refuses(&[CORNER, "edges = \"x\"", MATERIAL], 2, &["two edges"]);
    refuses(&[CORNER, EDGES, MATERIAL, "radius = 1"], 4, &["unknown key `radius` in [[quads]]"]);
    refuses(
        &["center = [0, 0, 0]", EDGES, MATERIAL],
        1,
        &["unknown key `center`", "expected one of corner, edges, material"],
    );
    refuses(&[CORNER, EDGES, "material = \"grey\""], 3, &["grey"]);
    refuses(&[CORNER, MATERIAL], 0, &["edges = [[x, y, z], [x, y, z]]"]);
    refuses(&[EDGES, MATERIAL], 0, &["corner = [x, y, z]"]);
}
