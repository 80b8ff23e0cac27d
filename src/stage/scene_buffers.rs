//! A packed scene's tables on an OpenCL device, for all kernels that follow rays.

use crate::device::cl::{Arguments, Buffer, Context};
use crate::error::Result;
use crate::packing::Packed;
use crate::records::TEXEL;

/// The tables of [`Packed::tables`]. Buffers may be longer than what they hold.
#[derive(Default)]
pub struct SceneBuffers {
    tables: Vec<(&'static str, Buffer<[f32; TEXEL]>)>,
    /// Shapes in the scene.
    pub shapes: usize,
}

impl SceneBuffers {
    /// A scene's tables.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device has no room.
    pub fn new(context: &Context, packed: &Packed) -> Result<SceneBuffers> {
        let mut tables = SceneBuffers::default();
        tables.upload(context, packed)?;
        Ok(tables)
    }

    /// Takes over another scene, in the same memory where that suffices.
    ///
    /// # Errors
    /// As [`SceneBuffers::new`].
    pub fn upload(&mut self, context: &Context, packed: &Packed) -> Result<()> {
        self.tables.retain(|(name, _)| packed.tables().iter().any(|(wanted, _)| wanted == name));
        for (name, floats) in packed.tables() {
            let texels = bytemuck::cast_slice(floats);
            let place = match self.tables.iter().position(|(known, _)| *known == name) {
                Some(place) => place,
                None => {
                    self.tables.push((name, Buffer::new(context, texels.len())?));
                    self.tables.len() - 1
                }
            };
            let (_, buffer) = &mut self.tables[place];
            buffer.fit(context, texels.len())?;
            buffer.write(context, texels)?;
        }
        self.shapes = packed.shapes.len();
        Ok(())
    }

    /// As kernels take them.
    pub fn arguments(&self) -> Arguments {
        self.tables.iter().fold(Arguments::new(), |args, (name, buffer)| args.with(name, buffer))
    }
}
