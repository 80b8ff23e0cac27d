//! The suite's six graphs: a frame's time by image size for either scene and map, and by cells and tiles for either
//! scene, with the report's own figures in grey.

use super::Row;
use super::cases::{Case, Way};
use super::published::published;
use crate::bench::plot::{Chart, Curve, Look};
use crate::settings::{Backend, Choice};

/// How a curve is told from others: colour by backend, dashes by way.
fn look(backend: Backend, way: Way, is_published: bool) -> Look {
    let color = match (is_published, backend) {
        (true, Backend::Cpu) => Look::DARK_GREY,
        (true, _) => Look::GREY,
        (false, Backend::Cpu) => 0,
        (false, Backend::OpenCl) => 1,
        (false, Backend::OpenGl) => 2,
    };
    let dash = match way {
        Way::Grid | Way::Direct => 0,
        Way::Tiles => 8,
        Way::Auto => 3,
    };
    Look { color: Some(color), dash }
}

/// Name, value along x.
type Points<'a> = Vec<(&'a Case, f64, f64)>;

/// The curves of the rows that `x` gives a place, ours and the report's.
fn curves(rows: &[(&Case, &Row)], x: impl Fn(&Case) -> Option<f64>) -> Vec<Curve> {
    let mut curves = Vec::new();
    let backends = [Backend::Cpu, Backend::OpenCl, Backend::OpenGl];
    for (backend, way) in
        backends.into_iter().flat_map(|backend| [Way::Grid, Way::Tiles, Way::Auto].map(|way| (backend, way)))
    {
        let own: Points = rows
            .iter()
            .filter(|(case, _)| (case.backend, case.way) == (backend, way))
            .filter_map(|(case, row)| Some((*case, x(case)?, row.frame_ms)))
            .collect();
        add(&mut curves, format!("{}, {}", backend.row().title, way.name()), own, look(backend, way, false));
    }
    for backend in [Backend::Cpu, Backend::OpenCl] {
        for way in [Way::Grid, Way::Tiles] {
            let mut theirs: Points = Vec::new();
            for (case, _) in rows.iter().filter(|(case, _)| case.way == way) {
                let case_there = Case { backend, ..(*case).clone() };
                let Some((x, ms)) = x(case).zip(published(&case_there)) else { continue };
                if !theirs.iter().any(|(_, own, _)| *own == x) {
                    theirs.push((case, x, ms));
                }
            }
            let name = format!("report's {}, {}", backend.row().title, way.name());
            add(&mut curves, name, theirs, look(backend, way, true));
        }
    }
    curves
}

fn add(curves: &mut Vec<Curve>, name: String, mut points: Points, look: Look) {
    if !points.is_empty() {
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        let points = points.into_iter().map(|(_, x, y)| (x, y)).collect();
        curves.push(Curve { name, points, marked: None, look });
    }
}

/// Those of which there are points.
pub fn charts(rows: &[(&Case, &Row)]) -> Vec<(String, Chart)> {
    let mut charts = Vec::new();
    let mut sets: Vec<(&str, u32)> =
        rows.iter().filter_map(|(case, _)| Some((case.scene.as_str(), case.photons?))).collect();
    sets.sort_unstable();
    sets.dedup();
    let mut add = |name: String, title: String, x: &str, curves: Vec<Curve>| {
        if !curves.is_empty() {
            let chart = Chart { title, x: x.into(), y: "frame, ms".into(), curves };
            charts.push((name, chart));
        }
    };
    for &(scene, photons) in &sets {
        let of: Vec<_> =
            rows.iter().copied().filter(|(case, _)| case.scene == scene && case.photons == Some(photons)).collect();
        // The main table's cells and tiles; sweeps are another graph.
        let main = |case: &Case| {
            let usual = case.grid.is_none_or(|cells| cells.0 == 0.5) && case.tile.is_none_or(|tile| tile == [80, 80]);
            usual.then(|| f64::from(case.size[0] * case.size[1]))
        };
        add(
            format!("report-{scene}-{}k", photons / 1000),
            format!("{scene}, {photons} photons, R = 1 m: a frame's time by image size"),
            "pixels",
            curves(&of, main),
        );
    }
    let mut scenes: Vec<&str> = sets.iter().map(|(scene, _)| *scene).collect();
    scenes.dedup();
    for scene in scenes {
        let of: Vec<_> = rows
            .iter()
            .copied()
            .filter(|(case, _)| case.scene == scene && case.size == [640, 480] && case.photons == Some(12_000))
            .collect();
        // One axis for both, as the report pairs them: 80 pixels with 2 m down to 10 pixels with 0.25 m.
        let swept = |case: &Case| match (case.grid, case.tile) {
            (Some(cells), _) => Some(f64::from(cells.0)),
            (_, Some([width, _])) => Some(f64::from(width) / 40.0),
            _ => None,
        };
        add(
            format!("report-{scene}-sweep"),
            format!("{scene}, 640 x 480, 12000 photons, R = 1 m: a frame's time by cells and tiles"),
            "cells, m; tiles, pixels / 40",
            curves(&of, swept),
        );
    }
    charts
}
