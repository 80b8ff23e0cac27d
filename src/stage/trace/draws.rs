//! Cuts within a pixel: a fragment or work-item that would loop for too long shares its samples, and the candidates of a
//! query, among several draws. (`submissions.rs` cuts pictures into rows, which cannot help where one pixel takes too long.)

use super::{FinalPass, Indirect};
use crate::error::{Error, Result};
use crate::rays::shapes::quad::CUTS;
use crate::records::{Frame, Gather, SiteLattice};
use crate::settings::Method;

/// Loop rounds that a work-item may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounds {
    granted: u64,
    /// Whether more of them give a wrong picture rather than a late one.
    is_hard: bool,
}

/// llvmpipe ends a shader's loops, all of them together, after 65,535 rounds; some are left for small loops.
pub const LLVMPIPE: Rounds = Rounds { granted: 60_000, is_hard: true };

/// A candidate takes a lone work-item half a microsecond on an H200, where a picture with 1.2 million candidates a pixel
/// took 656 ms in whatever part of it: so many take 130 ms, should the bound on them be met.
pub const GPU: Rounds = Rounds { granted: 1 << 18, is_hard: false };

/// How a picture is cut into draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draws {
    /// Samples of a draw.
    pub samples: u64,
    /// Parts that the candidates of a query are gathered in.
    pub slices: u64,
}

/// What a query may meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// How it searches.
    pub method: Method,
    /// Cells along an axis that it touches.
    pub across: u64,
    /// A bound on the photons that it looks at.
    pub candidates: u64,
    /// Walls that may part it from a photon, where the program loops over them for each.
    pub walls: u64,
}

/// What programs loop over besides photons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Looped {
    /// Shapes of all kinds.
    pub shapes: u64,
    /// Of them, those that may part photons: flat ones.
    pub walls: u64,
    /// Lines that may cut a disc.
    pub cuts: u64,
    /// Lights.
    pub lights: u64,
}

impl Looped {
    /// Frames tell of all but quads.
    pub fn of(frame: &Frame, quads: usize) -> Looped {
        let [spheres, planes, lights] = [frame.sphere_count, frame.plane_count, frame.light_count].map(|n| n as u64);
        let quads = quads as u64;
        Looped { shapes: spheres + planes + quads, walls: planes + quads, cuts: planes + CUTS as u64 * quads, lights }
    }

    /// What a ray and the shadow rays from where it ends have to do, up to a factor.
    fn rays(&self) -> f64 {
        (self.shapes * (2 + self.lights)) as f64
    }
}

impl Draws {
    /// One draw of all samples and candidates.
    pub fn whole(frame: &Frame) -> Draws {
        Draws { samples: frame.samples as u64, slices: 1 }
    }

    /// Whether one draw does.
    pub fn is_whole(&self, frame: &Frame) -> bool {
        self.samples >= frame.samples as u64 && self.slices == 1
    }

    /// Draws short enough; `query`: of the photon map, where pixels gather from one.
    ///
    /// # Errors
    /// [`Error::Device`] when a single sample is too long where that would be wrong.
    pub fn within(
        rounds: Option<Rounds>,
        frame: &Frame,
        quads: usize,
        indirect: &Indirect,
        query: Option<Query>,
    ) -> Result<Draws> {
        let Some(Rounds { granted, is_hard }) = rounds else { return Ok(Draws::whole(frame)) };
        let samples = frame.samples as u64;
        let Looped { shapes, cuts, lights, .. } = Looped::of(frame, quads);
        // Closest hit, the flat shapes' sides, a shadow ray a light; the lines that may cut the clipped disc once, and twice
        // more for each of six that do; 32 bits of a Sobol' number.
        let mut fixed = shapes * (3 + lights) + lights + 2 * cuts * cuts.min(6) + 64;
        let mut candidates = 0;
        if let Indirect::Final(_, FinalPass { lattice, .. }) = indirect {
            fixed += lattice.rays.max(lattice.own_rays) as u64 * (shapes * (2 + lights) + lights + 1);
            fixed += lattice.points as u64 * (shapes + 1);
        }
        if let Some(query) = query {
            fixed += query.across * (2 * query.across + 1);
            candidates = (query.candidates + query.candidates / 256) * (1 + query.walls); // blocks of sums
            if query.method == Method::Knn {
                // A candidate may go down the heap; a heap cannot be filled in slices.
                fixed += candidates + 8 * query.candidates;
                candidates = 0;
            }
        }
        let left = match granted.checked_sub(fixed).filter(|left| *left > 0) {
            Some(left) => left,
            None if is_hard => {
                return Err(Error::Device(format!(
                    "OpenGL: a sample of this picture takes up to {fixed} loop rounds, and this software driver ends \
                     loops after {granted}: take --backend opencl, or fewer photons or a smaller radius"
                )));
            }
            None => granted,
        };
        let slices = candidates.div_ceil(left).max(1);
        let a_sample = fixed + candidates.div_ceil(slices);
        Ok(Draws { samples: if slices > 1 { 1 } else { (granted / a_sample).clamp(1, samples.max(1)) }, slices })
    }

    /// The frames of the draws, what each weighs in the picture, and which slice of the candidates it gathers.
    pub fn parts(self, frame: &Frame) -> impl Iterator<Item = (Frame, f32, u64)> + use<> {
        let (all, frame) = (frame.samples as u64, *frame);
        (0..all).step_by(self.samples as usize).flat_map(move |first| {
            let here = self.samples.min(all - first);
            let part = Frame { samples: here as f32, first_sample: frame.first_sample + first as f32, ..frame };
            (0..self.slices).map(move |slice| (part, here as f32 / all as f32, slice))
        })
    }
}

/// What a pixel has to do, up to a factor: its rays, and where they end the photons within the radius of the map that
/// `gather` belongs to, or the rays of a final gathering.
pub fn work(frame: &Frame, quads: usize, indirect: &Indirect, gather: Option<&Gather>) -> f64 {
    let each = match (indirect, gather) {
        (Indirect::Final(_, pass), _) => f64::from(pass.lattice.own_rays + pass.lattice.points),
        (_, Some(gather)) => f64::from(gather.photon_count) * f64::from(gather.radius).powi(2),
        (_, None) => 1.0,
    };
    f64::from(frame.samples) * Looped::of(frame, quads).rays() * each
}

/// What a site has to do, up to a factor.
pub fn site_work(frame: &Frame, quads: usize, lattice: &SiteLattice) -> f64 {
    f64::from(lattice.rays + lattice.points) * Looped::of(frame, quads).rays()
}

/// Cells that a query's ball can touch along a row of them, and along an axis across rows.
pub fn cells_across(gather: &Gather) -> [u64; 2] {
    // Tiles have cells of their own, of R/2 or larger.
    along_and_across(gather, 8, |radii| 2 * (1.001 * radii).ceil().min(1e6) as u64 + 2)
}

/// The same as a guess that is seldom exceeded, and never by much.
pub fn cells_within(gather: &Gather) -> [u64; 2] {
    along_and_across(gather, 5, |radii| (2.0 * radii).ceil().min(1e6) as u64 + 1)
}

/// What a count makes of the radius in cells, along rows and across them; `tiles` where the grid has no cells.
fn along_and_across(gather: &Gather, tiles: u64, count: impl Fn(f32) -> u64) -> [u64; 2] {
    let [u, v, w] = gather.cell;
    let cells = if gather.by_rows != 0.0 { [u, v.min(w)] } else { [u.min(v).min(w); 2] };
    cells.map(|cell| if cell > 0.0 { count(gather.radius / cell) } else { tiles })
}

/// Cells of a face or region, of so many along its axes, that a query touches at most.
pub fn touched(counts: [f32; 3], [along, across]: [u64; 2]) -> u64 {
    let [u, v, w] = counts.map(|count| count as u64);
    u.min(along) * v.min(across) * w.min(across)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(samples: f32) -> Frame {
        Frame { samples, sphere_count: 2.0, plane_count: 6.0, light_count: 1.0, ..Frame::default() }
    }

    fn draws(rounds: Rounds, samples: f32, method: Method, candidates: u64) -> Result<Draws> {
        drawn(rounds, samples, 0, Query { method, across: 8, candidates, walls: 0 })
    }

    fn drawn(rounds: Rounds, samples: f32, quads: usize, query: Query) -> Result<Draws> {
        Draws::within(Some(rounds), &frame(samples), quads, &Indirect::None, Some(query))
    }

    #[test]
    fn no_draw_loops_for_longer_than_is_granted() {
        for rounds in [LLVMPIPE, GPU] {
            for candidates in [0, 100, 10_000, 59_000, 1_000_000, 16_000_000] {
                let draws = draws(rounds, 16.0, Method::Grid, candidates).unwrap();
                let fixed = 8 * 4 + 1 + 2 * 6 * 6 + 64 + 8 * 17;
                let a_draw = draws.samples * (fixed + (candidates + candidates / 256).div_ceil(draws.slices));
                assert!(a_draw <= rounds.granted, "{candidates}: {draws:?} takes {a_draw}");
                assert_eq!(draws.is_whole(&frame(16.0)), candidates <= 10_000 && (rounds == GPU || candidates <= 100));
            }
        }
    }

    #[test]
    fn a_heap_is_refused_where_loops_end_early_and_drawn_where_they_last() {
        assert!(draws(LLVMPIPE, 1.0, Method::Knn, 100_000).unwrap_err().to_string().contains("loop rounds"));
        assert_eq!(draws(GPU, 4.0, Method::Knn, 100_000).unwrap(), Draws { samples: 1, slices: 1 });
    }

    #[test]
    fn quads_count_as_shapes_walls_and_four_lines_each() {
        let looped = Looped::of(&frame(1.0), 5);
        assert_eq!(looped, Looped { shapes: 13, walls: 11, cuts: 26, lights: 1 });
        // Each candidate asks all walls: a dozen times the rounds, in as many more slices.
        let query = |walls| Query { method: Method::Grid, across: 8, candidates: 500_000, walls };
        let slices = |quads, walls| drawn(LLVMPIPE, 1.0, quads, query(walls)).unwrap().slices;
        assert_eq!([slices(5, 0), slices(5, 11)], [9, 102]);
        // Thousands of quads leave a software driver's loop nothing.
        assert!(drawn(LLVMPIPE, 1.0, 5_000, query(0)).is_err());
        // A scene of quads alone is work.
        let alone = Frame { sphere_count: 0.0, plane_count: 0.0, ..frame(1.0) };
        assert!(work(&alone, 5, &Indirect::None, None) > 0.0);
    }

    #[test]
    fn parts_make_up_the_whole() {
        let parts: Vec<_> = Draws { samples: 3, slices: 2 }.parts(&frame(8.0)).collect();
        assert_eq!(parts.len(), 6);
        for slice in 0..2 {
            let own: Vec<_> = parts.iter().filter(|(_, _, number)| *number == slice).collect();
            assert!((own.iter().map(|(_, weight, _)| weight).sum::<f32>() - 1.0).abs() < 1e-6);
            let samples: Vec<_> = own.iter().map(|(frame, ..)| (frame.first_sample, frame.samples)).collect();
            assert_eq!(samples, [(0.0, 3.0), (3.0, 3.0), (6.0, 2.0)]);
        }
    }
}
