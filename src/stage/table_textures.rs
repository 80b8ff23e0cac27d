//! Tables as textures, found by their names in a shader and here alike.

use crate::device::gl::{Functions, Program, TableTexture};
use crate::error::Result;
use crate::packing::Packed;
use crate::records::TEXTURE_WIDTH_LOG2;
use crate::records::table_sets::{PACKED, TableSet};

/// A texture for each table of some sets.
pub struct TableTextures {
    tables: Vec<(&'static str, TableTexture)>,
}

impl TableTextures {
    /// Empty tables on the current context.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions, sets: &[&TableSet]) -> Result<TableTextures> {
        let mut tables: Vec<(&'static str, TableTexture)> = Vec::new();
        for name in sets.iter().flat_map(|set| set.textures(None)) {
            if tables.iter().all(|(known, _)| *known != name) {
                tables.push((name, TableTexture::new(gl, TEXTURE_WIDTH_LOG2)?));
            }
        }
        Ok(TableTextures { tables })
    }

    /// A table, to be filled.
    ///
    /// # Panics
    /// When none of the sets has it.
    pub fn table(&mut self, name: &str) -> &mut TableTexture {
        let found = self.tables.iter_mut().find(|(known, _)| *known == name);
        found.map(|(_, table)| table).unwrap_or_else(|| panic!("no table named {name} among these textures"))
    }

    /// Binds what the active program reads of them.
    pub fn bind(&self, program: &Program) {
        for (name, table) in &self.tables {
            table.bind(program, name);
        }
    }

    /// How often a table was filled.
    pub fn uploads(&self) -> u64 {
        self.tables.iter().map(|(_, table)| table.uploads).sum()
    }

    /// Bytes on the device, padding included.
    pub fn bytes(&self) -> usize {
        self.tables.iter().map(|(_, table)| table.bytes()).sum()
    }
}

/// A packed scene's tables: as textures, or of a small scene as uniforms.
pub struct SceneTextures {
    textures: TableTextures,
    /// What travels in uniforms; then no texture is filled.
    small: Option<Packed>,
}

impl SceneTextures {
    /// Empty tables on the current context.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions) -> Result<SceneTextures> {
        Ok(SceneTextures { textures: TableTextures::new(gl, &[&PACKED])?, small: None })
    }

    /// Takes over a scene; `in_uniforms`: for programs that have it there.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when a table is larger than the driver's textures.
    pub fn upload(&mut self, packed: &Packed, in_uniforms: bool) -> Result<()> {
        self.small = in_uniforms.then(|| packed.clone());
        if in_uniforms {
            return Ok(());
        }
        for (name, floats) in packed.tables() {
            self.textures.table(name).fill_texels(floats)?;
        }
        Ok(())
    }

    /// Gives the active program its scene.
    pub fn bind(&self, program: &Program) {
        match &self.small {
            Some(packed) => packed.tables().into_iter().for_each(|(name, floats)| program.set_texels(name, floats)),
            None => self.textures.bind(program),
        }
    }

    /// Bytes on the device, padding included.
    pub fn bytes(&self) -> usize {
        self.textures.bytes()
    }
}
