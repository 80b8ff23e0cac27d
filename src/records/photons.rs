//! Records of emission, of the photon map, and of the grid and tiles that it is sorted into.

use bytemuck::{Pod, Zeroable};

use super::record::{Field, Record, TEXEL, record};

record! {
    /// A light as the photon paths leave it.
    Emitter, "emitter" in "emitters" {
        /// Scene space, metres.
        position: [f32; 3],
        /// Throughput that a path begins with: the light's colour, its largest channel 1. Walks depend on this alone,
        /// so that the same path is walked however many others there are.
        color: [f32; 3],
        /// Power of one path in its largest channel, watts.
        power: f32,
        /// Zero.
        reserved: f32,
        /// Zero.
        unused: f32,
    }
}

record! {
    /// Where a photon landed. Photon tables are separate, one texel a property: a rejected candidate costs one fetch.
    PhotonPosition, "photon" in "photon_positions" {
        /// Scene space, metres.
        position: [f32; 3],
    }
}

record! {
    /// What a photon brought.
    PhotonPower, "photon" in "photon_powers" {
        /// Flux ΔΦ, watts per channel.
        power: [f32; 3],
    }
}

record! {
    /// How a photon came; only where a glossy surface needs it.
    PhotonDirection, "photon" in "photon_directions" {
        /// Unit, towards where the photon came from.
        direction: [f32; 3],
    }
}

record! {
    /// One side of one object (2·sheet + 0 | 1) as the photon grid sees it. See `cell.glsl` for u, v, w.
    Face, "face" in "faces" {
        /// Lowest corner of the face's cells along u, v, w; scene space, metres. Zero in the hashed form.
        origin: [f32; 3],
        /// Cells along u, v, w; zero where the face has no photons, and in the hashed form.
        counts: [f32; 3],
        /// The face's first cell in the table; in the hashed form how far its rows are moved along the table.
        base: f32,
        /// 1: u is y and v is x; 0: u, v, w are x, y, z.
        flipped: f32,
        /// First bucket of the hashed table that its rows wrap in; zero in the dense form.
        table: f32,
    }
}

record! {
    /// What gathering needs besides the tables.
    Gather, "gather" in "gather" {
        /// R, metres.
        radius: f32,
        /// 1/R.
        inverse_radius: f32,
        /// Photons in the map.
        photon_count: f32,
        /// A cell's size along x, y, z (but see `by_rows`); metres.
        cell: [f32; 3],
        /// 1 / `cell`, rounded once, here: build and query must divide alike.
        inverse_cell: [f32; 3],
        /// Length of a hashed table − 1.
        bucket_mask: f32,
        /// k of the k nearest.
        nearest: f32,
        /// Every how many-th candidate is gathered in one draw; 1 but for drivers that end long loops.
        slices: f32,
        /// Which of them this draw gathers, below `slices`.
        slice: f32,
        /// Tiles in a row of them.
        tiles_across: f32,
        /// A tile's width and, below, its height; pixels.
        tile_width: f32,
        /// Pixels.
        tile_height: f32,
        /// 1 where `cell` is a size along u, v, w of every face, whichever axes those are; 0 where along x, y, z.
        by_rows: f32,
        /// Zero.
        spare: f32,
    }
}

record! {
    /// A rectangle of pixels: which regions it sees.
    Tile, "tile" in "tiles" {
        /// Its first region.
        first: f32,
        /// Regions.
        count: f32,
        /// Zero.
        reserved: f32,
    }
}

record! {
    /// What a tile sees of one face, and the cells that the photons around it are sorted into. See `tile.glsl`.
    Region, "region" in "regions" {
        /// Lowest corner of the box of the tile's visible points on the face; scene space, metres.
        low: [f32; 3],
        /// Highest corner.
        high: [f32; 3],
        /// Lowest corner of the cells along u, v, w; scene space, metres.
        origin: [f32; 3],
        /// Cells along u, v, w.
        counts: [f32; 3],
        /// A cell's size along x, y, z; metres.
        cell: [f32; 3],
        /// 1 / `cell`, rounded once, here.
        inverse_cell: [f32; 3],
        /// A face: see [`super::face`].
        face: f32,
        /// The region's first cell in the table.
        base: f32,
        /// 1: u is y and v is x; 0: u, v, w are x, y, z.
        flipped: f32,
        /// Squared distance from the box within which photons are on the list, m²: R², and what coordinates round.
        margin2: f32,
        /// Zero.
        reserved: f32,
        /// Zero.
        spare: f32,
    }
}
