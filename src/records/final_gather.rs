//! Records of final gathering: charts of irradiance texels, sites, lit points.

use bytemuck::{Pod, Zeroable};

use super::record::{Field, Record, TEXEL, record};

record! {
    /// How an object's surface is cut into irradiance texels. See `texels.glsl`.
    Chart, "chart" in "charts" {
        /// Plane: its first coordinate is `dot(axis_u, p) + offset_u`; scene space, 1/m. Sphere: zero.
        axis_u: [f32; 3],
        /// The second one's.
        axis_v: [f32; 3],
        /// See `axis_u`.
        offset_u: f32,
        /// See `axis_v`.
        offset_v: f32,
        /// 1: coordinates x are bent to x/(1 + |x|), for planes without an end; 0: they lie in [−1, 1] already.
        bend: f32,
        /// The first texel, of the side that the object's own normal points to; the other side's follow.
        first: f32,
        /// Texels along the first coordinate.
        columns: f32,
        /// Texels along the second one.
        rows: f32,
    }
}

record! {
    /// What an irradiance texel knows.
    Texel, "texel" in "texels" {
        /// Irradiance by photons of at least one bounce, W/m².
        irradiance: [f32; 3],
    }
}

record! {
    /// The lattice of sites at which irradiance is gathered for the pixels around. See `final.glsl`.
    SiteLattice, "lattice" in "lattice" {
        /// Where the lattice begins on the image plane, pixels, below `spacing`.
        offset_x: f32,
        /// Below.
        offset_y: f32,
        /// Pixels from site to site.
        spacing: f32,
        /// Sites in a row.
        columns: f32,
        /// Rows of sites.
        rows: f32,
        /// Rays of a site.
        rays: f32,
        /// Rays of a sample that gathers for itself.
        own_rays: f32,
        /// How many passes have gone on in the same sequences before.
        turn: f32,
        /// Low 16 bits of the key of all sites' sequences.
        key_low: f32,
        /// Its high 16 bits.
        key_high: f32,
        /// Lit points.
        points: f32,
        /// Density of lit points for each ray of a site and for the irradiance there, summed over the channels; 1/W.
        points_per_watt: f32,
        /// How far sites count, as a share of what is usual.
        reach: f32,
        /// Zero.
        reserved: f32,
        /// Zero.
        spare: f32,
    }
}

record! {
    /// A point that light from a point light reaches first. See `final.glsl`.
    LitPoint, "lit_point" in "lit_points" {
        /// Scene space.
        position: [f32; 3],
        /// Unit, towards the side that is lit.
        normal: [f32; 3],
        /// What it brings to a site where rays have no share in it, W/m².
        irradiance: [f32; 3],
        /// Density of such points for each ray of a site, 1/m².
        density: f32,
        /// The shape that it lies on.
        shape: f32,
        /// Zero.
        reserved: f32,
    }
}

record! {
    /// A site's irradiance.
    Site, "site" in "sites" {
        /// Indirect irradiance, W/m².
        irradiance: [f32; 3],
    }
}

record! {
    /// What a site lies on.
    SiteSurface, "site_surface" in "site_surfaces" {
        /// A face: see [`super::face`], −1 where the site's ray hit nothing.
        face: f32,
        /// From the camera, metres.
        distance: f32,
        /// Zero.
        reserved: f32,
    }
}
