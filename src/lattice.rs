//! Where final gathering's sites lie in one pass.

use crate::cpu::final_gather::R2_STEPS;
use crate::cpu::random::{sequence_u, unit_real};
use crate::layout::SiteLattice;
use crate::settings::{FinalGather, Settings};

/// The lattice of a pass. It lies elsewhere in every pass, evenly over the passes, so that their mean knows no lattice.
pub fn lattice(settings: &Settings, gather: &FinalGather) -> SiteLattice {
    let spacing = gather.spacing as f32;
    let place = |step| unit_real(sequence_u(settings.photons.pass, step, 1 << 31)) * spacing;
    // One site beyond each border, and one more because the lattice is shifted by up to a whole spacing.
    let sites = |pixels: u32| (pixels.div_ceil(gather.spacing.max(1)) + 2) as f32;
    SiteLattice {
        offset_x: place(R2_STEPS[0]),
        offset_y: place(R2_STEPS[1]),
        spacing,
        columns: sites(settings.width),
        rows: sites(settings.height),
        rays: gather.rays as f32,
        first_ray: gather.first_ray as f32,
        key_low: (settings.seed & 0xffff) as f32,
        key_high: (settings.seed >> 16) as f32,
    }
}
