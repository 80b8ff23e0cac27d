//! Final gathering's tables on OpenGL: irradiance texels as textures, and the sites, which a shader draws.

use crate::device::gl::{Functions, Program, Target};
use crate::error::{Error, Result};
use crate::records::table_sets::{CHARTS, FINAL_GATHER};
use crate::records::{Chart, LitPoint, Record, Site, SiteLattice, SiteSurface, TEXTURE_WIDTH_LOG2, Texel};
use crate::stage::irradiance::IrradianceView;
use crate::stage::table_textures::TableTextures;

/// What final gathering reads, as textures.
pub struct FinalTextures {
    gl: Functions,
    tables: TableTextures,
    /// Irradiance and surfaces of the sites; rows of a table's width.
    sites: Option<(u32, Target)>,
}

impl FinalTextures {
    /// Empty tables on the current context.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions) -> Result<FinalTextures> {
        let tables = TableTextures::new(gl, &[&CHARTS, &FINAL_GATHER])?;
        Ok(FinalTextures { gl: gl.clone(), tables, sites: None })
    }

    /// Takes over irradiance texels.
    ///
    /// # Errors
    /// [`Error::Device`] when a transfer fails, or a table is larger than the driver's textures.
    pub fn fill(&mut self, irradiance: &IrradianceView) -> Result<u64> {
        let (charts, texels) = irradiance.read()?;
        self.tables.table(Chart::TABLE).fill(&charts)?;
        self.tables.table(Texel::TABLE).fill(&texels)?;
        Ok(2)
    }

    /// Takes over a pass's lit points.
    ///
    /// # Errors
    /// As [`FinalTextures::fill`].
    pub fn fill_points(&mut self, points: &[LitPoint]) -> Result<()> {
        self.tables.table(LitPoint::TABLE).fill(points)
    }

    /// Gives the active program all this, and the sites where they are drawn.
    pub fn bind(&self, program: &Program) {
        self.tables.bind(program);
        if let Some((_, target)) = &self.sites {
            target.bind(0, program, Site::TABLE);
            target.bind(1, program, SiteSurface::TABLE);
        }
    }

    /// Draws the sites with the active program; `work`: of a site.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver refuses the size or reports an error.
    pub fn draw_sites(&mut self, program: &Program, lattice: &SiteLattice, work: f64) -> Result<()> {
        let count = lattice.columns as u32 * lattice.rows as u32;
        let rows = count.div_ceil(1 << TEXTURE_WIDTH_LOG2);
        if self.sites.as_ref().is_none_or(|(known, _)| *known < rows) {
            let target = Target::of_tables(&self.gl, 1 << TEXTURE_WIDTH_LOG2, rows, 2)?;
            self.sites = Some((rows, target));
        }
        let Some((_, target)) = &self.sites else {
            return Err(Error::Device("OpenGL: no target for the sites".into()));
        };
        // Only now: making a target binds its textures.
        self.tables.bind(program);
        target.pace.expect(work);
        target.draw(program)
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        self.tables.bytes() + self.sites.as_ref().map_or(0, |(_, target)| target.bytes())
    }
}
