//! Points on the surfaces at which indirect irradiance is estimated once for the whole image.
//!
//! A path's deep bounces are most of its noise and of its cost, yet indirect light hardly differs from a point to its
//! neighbour. So the path borrows the irradiance of the nearest anchor, and now and then the *difference* between the
//! two points is estimated, with one path for both, and added at the right weight: a two-level Monte Carlo estimate
//! (Heinrich 2001; Giles 2008), unbiased wherever the anchors lie and however noisy they still are.

use std::collections::HashMap;

use glam::DVec3;

use super::shapes::SurfaceId;

/// A point on one side of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    /// A place on the surface: world space, metres.
    pub position: DVec3,
    /// Unit, on the side whose irradiance is meant.
    pub normal: DVec3,
    /// The surface it lies on.
    pub surface: SurfaceId,
}

/// Surface, octant of the normal (which tells a plane's sides apart), cell of a grid in space.
type Cell = (SurfaceId, u8, [i32; 3]);

/// Where paths from the camera go second, thinned to one point a cell.
#[derive(Default)]
pub(super) struct Anchors {
    spacing: f64,
    cells: HashMap<Cell, u32>,
    points: Vec<Anchor>,
}

impl Anchors {
    /// About `most` anchors for the `visited` points, on the finest grid that needs no more.
    pub fn new(visited: &[Anchor], most: usize) -> Self {
        let extent = visited.iter().map(|v| (v.position - visited[0].position).length()).fold(0.0, f64::max);
        if visited.is_empty() || most == 0 || extent <= 0.0 {
            return Self::default();
        }
        // A thousandth of the scene is finer than any grid that `most` cells can fill.
        let mut spacing = extent / 1000.0;
        loop {
            // Counted before those seen once are dropped: on a far too fine grid nearly all are.
            let (anchors, cells) = Self::on_grid(visited, spacing);
            // Surfaces and octants set a least number, which a coarser grid cannot go below.
            if cells <= most || spacing > extent {
                return anchors;
            }
            spacing *= std::f64::consts::SQRT_2;
        }
    }

    fn on_grid(visited: &[Anchor], spacing: f64) -> (Self, usize) {
        let mut best: HashMap<Cell, (usize, f64, u32)> = HashMap::new();
        for (index, point) in visited.iter().enumerate() {
            let off = (point.position / spacing - (point.position / spacing).round()).length_squared();
            let entry =
                best.entry(cell(point.surface, point.normal, point.position, spacing)).or_insert((index, off, 0));
            if off < entry.1 {
                (entry.0, entry.1) = (index, off);
            }
            entry.2 += 1;
        }
        let count = best.len();
        // Cells seen once are not worth an anchor. The map's order is random: go by the order of the visits.
        let mut kept: Vec<_> = best.into_iter().filter(|(_, (_, _, visits))| *visits > 1).collect();
        kept.sort_by_key(|(_, (index, _, _))| *index);
        let anchors = Self {
            spacing,
            points: kept.iter().map(|(_, (index, _, _))| visited[*index]).collect(),
            cells: kept.iter().enumerate().map(|(number, (cell, _))| (*cell, number as u32)).collect(),
        };
        (anchors, count)
    }

    /// In a fixed order; the index is what [`Anchors::find`] returns.
    pub fn points(&self) -> &[Anchor] {
        &self.points
    }

    /// The anchor that stands for a point, if there is one.
    #[inline]
    pub fn find(&self, surface: SurfaceId, normal: DVec3, position: DVec3) -> Option<usize> {
        if self.points.is_empty() {
            return None;
        }
        self.cells.get(&cell(surface, normal, position, self.spacing)).map(|&index| index as usize)
    }
}

#[inline]
fn cell(surface: SurfaceId, normal: DVec3, position: DVec3, spacing: f64) -> Cell {
    let at = (position / spacing).round();
    let octant = u8::from(normal.x > 0.0) | u8::from(normal.y > 0.0) << 1 | u8::from(normal.z > 0.0) << 2;
    (surface, octant, [at.x as i32, at.y as i32, at.z as i32])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floor(normal: DVec3) -> Vec<Anchor> {
        let point = |i: i32| DVec3::new(f64::from(i % 100) * 0.1, 0.0, f64::from(i / 100) * 0.1);
        (0..10_000).map(|i| Anchor { position: point(i), normal, surface: 3 }).collect()
    }

    #[test]
    fn anchors_are_few_near_and_on_the_right_side() {
        let visited = floor(DVec3::Y);
        let anchors = Anchors::new(&visited, 400);
        assert!((150..=400).contains(&anchors.points().len()), "{}", anchors.points().len());
        for point in &visited {
            if let Some(index) = anchors.find(3, DVec3::Y, point.position) {
                assert!((anchors.points()[index].position - point.position).length() < 1.0);
            }
            assert_eq!(anchors.find(3, DVec3::NEG_Y, point.position), None);
            assert_eq!(anchors.find(2, DVec3::Y, point.position), None);
        }
        assert!(Anchors::new(&[], 400).points().is_empty());
        assert!(Anchors::new(&visited[..1], 400).points().is_empty());
        let one = Anchors::new(&visited, 1).points().len();
        assert!((1..=9).contains(&one), "a grid cell per corner at most: {one}");
        assert!(Anchors::new(&visited, 0).points().is_empty());
    }
}
