//! The scene parser: what it accepts, what it refuses and where, and that no bytes make it panic.

mod accepted;
mod mutated;
mod refused;

/// A scene with one of everything; `refused` breaks it in one place at a time, so its line numbers matter.
const GOOD: &str = r#"# one of everything
[camera]
position = [0, 1, 5]
look_at = [0, 0, 0]
up = [0, 1, 0]
fov_y = 53.13

[materials.white]
color = [0.9, 0.9, 0.8]
diffuse = 0.5
specular = 0.25
roughness = 0.2
transmission = 0.0
ior = 1.5
ambient = 0.0

[[lights]]
position = [0, 3, 0]
intensity = [10, 20, 30]

[[spheres]]
center = [0, 1, 0]
radius = 1.0
material = "white"

[[planes]]
normal = [0, 2, 0]
offset = -1
material = "white"

[render]
size = [640, 480]
photons = 200_000
radius = 0.25
gather = "tiled-grid"
light = "hybrid"
passes = 4
exposure = -1.5
"#;
