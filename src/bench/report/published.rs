//! What the 2016 report measured: N. Shkurkin, Appendix C, milliseconds a frame. SC: one CPU thread (2.3 GHz Core i7);
//! CL: OpenCL (GeForce GT 650M).

use crate::settings::Backend;

use super::cases::{Case, Way};

/// The report's tables, a row a setting; a comment and a line of names come first.
const TABLES: &str = include_str!("tables-2016.csv");

/// A row of the tables.
#[derive(Clone, Debug, PartialEq)]
struct Published<'a> {
    scene: &'a str,
    /// Width, height, photons.
    numbers: [u32; 3],
    /// Cells along z, x, y of its box.
    grid: &'a str,
    tile: &'a str,
    /// Direct on SC and CL, grid and tiles on SC, grid and tiles on CL.
    ms: [Option<f64>; 6],
}

fn rows() -> impl Iterator<Item = Published<'static>> {
    let line = |line: &'static str| {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse().unwrap_or(0);
        Published {
            scene: cells[0],
            numbers: [number(1), number(2), number(3)],
            grid: cells[4],
            tile: cells[5],
            ms: [6, 7, 8, 9, 10, 11].map(|i| cells[i].parse().ok()),
        }
    };
    TABLES.lines().filter(|line| !line.starts_with(['#', 's']) || line.starts_with("sphere")).map(line)
}

/// The report's milliseconds for a case, where it has them: its one CPU thread's beside the CPU's, its OpenCL's beside
/// OpenCL's and OpenGL's, which gathers what OpenCL has emitted as the report's program did.
pub fn published(case: &Case) -> Option<f64> {
    let cpu = case.backend == Backend::Cpu;
    let column = match (case.way, cpu) {
        (Way::Direct, cpu) => usize::from(!cpu),
        (Way::Grid, true) => 2,
        (Way::Tiles, true) => 3,
        (Way::Grid, false) => 4,
        (Way::Tiles, false) => 5,
        (Way::Auto, _) => return None,
    };
    let same = |row: &Published| {
        let [width, height, photons] = row.numbers;
        row.scene == case.scene
            && [width, height] == case.size
            && case.photons.is_none_or(|own| own == photons)
            && case.grid.is_none_or(|own| own.name() == row.grid)
            && case.tile.is_none_or(|[w, h]| format!("{w}x{h}") == row.tile)
    };
    // Of cases that it measured twice the first: that is the table its graphs were drawn from.
    rows().filter(same).find_map(|row| row.ms[column])
}

#[cfg(test)]
mod tests {
    use super::super::cases::{Cells, cases};
    use super::*;

    #[test]
    fn every_row_of_the_report_is_read_and_found() {
        assert_eq!(rows().count(), 20);
        let all = cases(&["gi_ref", "sphere_and_plane"], &[Backend::OpenCl], &[12_000, 200_000]);
        let found = |way| all.iter().filter(|case| case.way == way && published(case).is_some()).count();
        assert_eq!((found(Way::Direct), found(Way::Grid), found(Way::Tiles)), (6, 18, 18));
        let case = Case {
            scene: "gi_ref".into(),
            size: [640, 480],
            photons: Some(12_000),
            way: Way::Grid,
            grid: Some(Cells(0.25)),
            tile: None,
            backend: Backend::OpenCl,
        };
        assert_eq!(published(&case), Some(1413.0));
        assert_eq!(published(&Case { backend: Backend::Cpu, ..case.clone() }), Some(9500.0));
        assert_eq!(published(&Case { grid: Some(Cells(0.1)), ..case }), None);
    }
}
