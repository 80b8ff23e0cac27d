//! What a photon map takes on the device, so that it can be said before it is there: 64 bytes a stored photon at most,
//! whatever the scene's extent, all scratch included.

/// Bytes of a texel.
const TEXEL: usize = 12;

/// Most bytes of a stored photon on the OpenCL device, small maps apart.
pub const PER_PHOTON: usize = 64;

/// Records that tables for `stored` photons have: a little more, so that the next pass, which stores a few more or
/// less, finds room as well; and whole pages, which the sort divides among its own tables.
pub fn capacity(stored: usize) -> usize {
    (stored + stored / 64).next_multiple_of(1024)
}

/// Entries that the table of cells may have: what the other tables leave of [`PER_PHOTON`]. Position, power and, in
/// glossy scenes, direction are a texel each, and one more the sort works in; face and order are 4 bytes each. Small
/// maps may have small tables of more entries than that.
pub fn table_entries(glossy: bool, stored: usize) -> usize {
    (if glossy { stored + stored / 16 } else { 4 * stored }).max(1 << 16)
}

/// Bytes that emission on CPUs records a batch of paths in, which its cores' caches should hold.
pub const RECORDING_BYTES: usize = 2_750_000;

/// Floats that a photon is recorded in: position, power, face, direction.
pub fn recorded_floats(glossy: bool) -> u32 {
    if glossy { 10 } else { 7 }
}

/// Most bytes that a sorted map takes in OpenCL, emission, sort and all.
pub fn opencl_bytes(glossy: bool, stored: usize) -> usize {
    let tables = if glossy { 4 } else { 3 };
    // Boxes of faces, totals of scans, and the like.
    let small = 1 << 16;
    capacity(stored) * (tables * TEXEL + 4 + 4) + 4 * table_entries(glossy, stored) + RECORDING_BYTES + small
}

/// Most bytes that its copy takes in textures: positions, powers, directions, cells.
pub fn texture_bytes(glossy: bool, stored: usize) -> usize {
    let tables = 2 + usize::from(glossy);
    // Each texture's last row is a whole one.
    let rows = ((tables + 1) * TEXEL) << crate::records::TEXTURE_WIDTH_LOG2;
    stored * tables * TEXEL + 4 * table_entries(glossy, stored) + rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_photons_fit_into_64_megabytes() {
        for glossy in [false, true] {
            for stored in [1_000_000, 1_234_567, 4_000_000] {
                let bytes = opencl_bytes(glossy, stored);
                assert!(bytes <= PER_PHOTON * stored, "{stored} photons, glossy {glossy}: {bytes} bytes");
                assert!(texture_bytes(glossy, stored) <= PER_PHOTON * stored);
            }
        }
    }
}
