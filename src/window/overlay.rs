//! Markers over the picture: photons, cells, tiles.

use egui::{Color32, Mesh, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2};
use glam::DVec3;

use super::markers::{Cell, Dot, Markers, Tiling};
use super::pick::project;
use crate::scene::Camera;

/// Draws markers over the area that shows the picture. `size` is the picture's, pixels.
pub fn draw(painter: &Painter, area: Rect, camera: &Camera, markers: &Markers, size: [u32; 2]) {
    let painter = painter.with_clip_rect(area);
    let place = |point: DVec3| -> Option<Pos2> {
        let (x, y, _) = project(camera, f64::from(area.width() / area.height()), point)?;
        // Far outside, f32 would lose what little there is to see.
        let near = x.abs() < 10.0 && y.abs() < 10.0;
        near.then(|| area.min + vec2(x as f32 * area.width(), y as f32 * area.height()))
    };
    if let Some(tiles) = &markers.tiles {
        tiling(&painter, area, tiles, size);
    }
    cells(&painter, &markers.cells, &place);
    dots(&painter, &markers.dots, &place);
    let shown = [
        (markers.dots.len(), "photons shown"),
        (markers.cells.len(), "cells shown"),
        (markers.tiles.as_ref().map_or(0, |t| t.counts.len()), "tiles"),
    ];
    let text: Vec<String> =
        shown.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    let at = area.left_bottom() + vec2(6.0, -6.0);
    label(&painter, at, egui::Align2::LEFT_BOTTOM, &text.join(", "));
}

/// Text that can be read over any picture.
pub fn label(painter: &Painter, at: Pos2, align: egui::Align2, text: &str) {
    if text.is_empty() {
        return;
    }
    let galley = painter.layout_no_wrap(text.into(), egui::FontId::proportional(12.0), Color32::WHITE);
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(3.0), 2.0, Color32::from_black_alpha(170));
    painter.galley(rect.min, galley, Color32::WHITE);
}

fn dots(painter: &Painter, dots: &[Dot], place: &impl Fn(DVec3) -> Option<Pos2>) {
    let mut mesh = Mesh::default();
    for (point, color) in dots {
        let Some(at) = place(*point) else { continue };
        let [r, g, b] = color.map(|c| (crate::film::display_value(c) * 255.0) as u8);
        mesh.add_colored_rect(Rect::from_center_size(at, vec2(2.0, 2.0)), Color32::from_rgb(r, g, b));
    }
    painter.add(Shape::mesh(mesh));
}

fn cells(painter: &Painter, cells: &[Cell], place: &impl Fn(DVec3) -> Option<Pos2>) {
    let most = cells.iter().map(|cell| cell.count).fold(1.0, f32::max);
    for cell in cells {
        let [Some(a), Some(b), Some(c), Some(d)] = cell.corners.map(place) else { continue };
        let stroke = Stroke::new(1.0, scale(cell.count / most, 230));
        painter.add(Shape::closed_line(vec![a, b, c, d], stroke));
    }
}

fn tiling(painter: &Painter, area: Rect, tiles: &Tiling, size: [u32; 2]) {
    let per_pixel = vec2(area.width() / size[0] as f32, area.height() / size[1] as f32);
    let most = tiles.counts.iter().copied().fold(1.0, f32::max);
    let across = tiles.across.max(1);
    for (i, count) in tiles.counts.iter().enumerate() {
        let corner = pos2((i % across) as f32 * tiles.size[0], (i / across) as f32 * tiles.size[1]);
        let min = area.min + vec2(corner.x * per_pixel.x, corner.y * per_pixel.y);
        let side = vec2(tiles.size[0] * per_pixel.x, tiles.size[1] * per_pixel.y);
        let rect = Rect::from_min_size(min, side);
        painter.rect_filled(rect.shrink(0.5), 0.0, scale(count / most, 110));
        if side.x >= 36.0 {
            let text = format!("{count}");
            painter.text(
                rect.center(),
                egui::Align2::CENTER_CENTER,
                text,
                egui::FontId::proportional(10.0),
                Color32::WHITE,
            );
        }
    }
}

/// Blue for few, over green and yellow, to red for the most.
fn scale(t: f32, alpha: u8) -> Color32 {
    let t = t.clamp(0.0, 1.0).sqrt(); // most cells hold few
    let channel = |center: f32| ((1.5 - (4.0 * t - center).abs()).clamp(0.0, 1.0) * 255.0) as u8;
    Color32::from_rgba_unmultiplied(channel(3.0), channel(2.0), channel(1.0), alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_photons_are_redder() {
        let [few, some, many] = [0.0, 0.3, 1.0].map(|t| scale(t, 255));
        assert!(few.b() > few.r() && some.g() > 100 && many.r() > many.b());
    }
}
