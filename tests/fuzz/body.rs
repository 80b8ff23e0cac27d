/// Parses a scene file of any bytes and checks what is promised of the outcome. Whether it was accepted.
///
/// # Panics
/// When a promise is broken: that is what fuzzing looks for.
pub fn parse(bytes: &[u8]) -> bool {
    match photile::scene::parse_bytes(bytes, "fuzzed.toml") {
        Ok(scene) => {
            let finite = scene.camera.position.is_finite() && scene.camera.look_at.is_finite();
            assert!(
                finite && scene.shapes.spheres.iter().all(|s| s.radius > 0.0 && s.material < scene.materials.len())
            );
            assert!(scene.shapes.planes.iter().all(|p| p.offset.is_finite() && p.material < scene.materials.len()));
            // Packing must not meet a number that float32 cannot hold.
            let packed = photile::packing::Packed::new(&scene, scene.camera.position);
            let held = |v: &[f32]| v.iter().all(|x| x.is_finite());
            assert!(packed.shapes.iter().all(|o| held(&o.anchor) && o.extent.is_finite()));
            assert!(packed.lights.iter().all(|l| held(&l.position) && held(&l.intensity)));
            true
        }
        Err(error) => {
            let printed = error.to_string();
            assert!(printed.starts_with("fuzzed.toml"), "{printed:?}");
            assert!(!printed.contains(|c: char| c.is_control()), "{printed:?}");
            false
        }
    }
}
