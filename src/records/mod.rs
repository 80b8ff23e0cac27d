//! Every record that crosses to a device, declared once: the host struct, its texels, and the accessors that
//! shaders and kernels see. This is the only folder with an offset in it.
//!
//! A record is a whole number of RGB texels. A three-component field fills a texel; scalars share one. The
//! [`prelude`](prelude()) turns the declarations into `#define`s that GLSL and OpenCL C both understand, on top of a few
//! fetch macros that the two shims define (`glsl/shim.glsl`, `kernels/shim.cl`).

pub mod face;
mod final_gather;
mod photons;
mod prelude;
mod record;
mod scene;
pub mod table_sets;
mod tables;
mod texture_shape;

pub use final_gather::*;
pub use photons::*;
pub use prelude::{field_reads, is_field, prelude};
pub use record::{Field, Record, TEXEL};
pub use scene::*;
pub use tables::*;
pub use texture_shape::{TEXTURE_WIDTH_LOG2, TextureShape};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_whole_texels() {
        assert_eq!((Shape::TEXELS, size_of::<Shape>()), (2, 24));
        assert_eq!((Material::TEXELS, size_of::<Material>()), (3, 36));
        assert_eq!(Light::TEXELS, 2);
    }

    #[test]
    fn accessors_point_where_the_host_struct_puts_the_field() {
        let text = prelude(None);
        assert!(text.contains("#define material_color(i) SCENE3(materials, i, 3, 0)"), "{text}");
        assert!(text.contains("#define shape_kind(i) SCENE1(shapes, i, 2, 1, 2)"), "{text}");
        assert!(text.contains("#define frame_height() PARAM1(frame, 4, 1)"), "{text}");
    }

    #[test]
    fn an_injected_fault_moves_one_accessor_only() {
        let (sound, broken) = (prelude(None), prelude(Some("shape.kind")));
        let changed: Vec<_> = sound.lines().zip(broken.lines()).filter(|(a, b)| a != b).collect();
        assert_eq!(changed.len(), 3);
        assert!(changed.iter().all(|(a, _)| a.contains("shape_kind")));
        assert!(is_field("shape.kind") && !is_field("shape.colour"));
    }

    #[test]
    fn shapes_hold_all_texels_in_power_of_two_rows() {
        for texels in [0, 1, 2, 3, 2047, 2048, 2049, 4_000_012] {
            let shape = TextureShape::of(texels, TEXTURE_WIDTH_LOG2);
            assert!(shape.width.is_power_of_two() && shape.texels() >= texels);
            assert!(shape.texels() - texels <= shape.width as usize);
        }
        assert_eq!(TextureShape::of(5, 11), TextureShape { width: 8, height: 1 });
        assert_eq!(TextureShape::of(4096, 11), TextureShape { width: 2048, height: 2 });
    }
}
