//! Final gathering's tables on OpenGL: irradiance texels as textures, and the sites, which a shader draws.

use crate::device::gl::{Functions, Program, TableTexture, Target};
use crate::error::{Error, Result};
use crate::records::{Chart, LitPoint, Record, Site, SiteLattice, SiteSurface, TEXTURE_WIDTH_LOG2, Texel};
use crate::stage::irradiance::IrradianceView;

/// What final gathering reads, as textures.
pub struct FinalTextures {
    gl: Functions,
    charts: TableTexture,
    texels: TableTexture,
    points: TableTexture,
    /// Irradiance and surfaces of the sites; rows of a table's width.
    sites: Option<(u32, Target)>,
}

impl FinalTextures {
    /// The samplers of `final.glsl`, in the order of their texture units.
    pub const SAMPLERS: [&str; 5] = [Chart::TABLE, Texel::TABLE, LitPoint::TABLE, Site::TABLE, SiteSurface::TABLE];

    /// Empty tables on the current context.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions) -> Result<FinalTextures> {
        let table = || TableTexture::new(gl, TEXTURE_WIDTH_LOG2);
        Ok(FinalTextures { gl: gl.clone(), charts: table()?, texels: table()?, points: table()?, sites: None })
    }

    /// Takes over irradiance texels.
    ///
    /// # Errors
    /// [`Error::Device`] when a transfer fails, or a table is larger than the driver's textures.
    pub fn fill(&mut self, irradiance: &IrradianceView) -> Result<u64> {
        let (charts, texels) = irradiance.read()?;
        self.charts.fill(&charts)?;
        self.texels.fill(&texels)?;
        Ok(2)
    }

    /// Takes over a pass's lit points.
    ///
    /// # Errors
    /// As [`FinalTextures::fill`].
    pub fn fill_points(&mut self, points: &[LitPoint]) -> Result<()> {
        self.points.fill(points)
    }

    /// Binds charts, texels and lit points, and the sites once they are drawn, from a texture unit on.
    pub fn bind(&self, first: u32, sites: bool) {
        self.charts.bind(first);
        self.texels.bind(first + 1);
        self.points.bind(first + 2);
        if let (true, Some((_, target))) = (sites, &self.sites) {
            target.bind(0, first + 3);
            target.bind(1, first + 4);
        }
    }

    /// Draws the sites with the active program, whose first three samplers are charts, texels and lit points;
    /// `work`: of a site.
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
        self.bind(0, false);
        target.pace.expect(work);
        target.draw(program)
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        self.charts.bytes()
            + self.texels.bytes()
            + self.points.bytes()
            + self.sites.as_ref().map_or(0, |(_, target)| target.bytes())
    }
}
