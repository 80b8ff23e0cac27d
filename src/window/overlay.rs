//! What is drawn over the picture: photons, cells, tiles; where the lights are; what is seen on which side.

use egui::{Color32, Mesh, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2};
use glam::DVec3;

use super::markers::{Cell, Dot, Tiling};
use super::pane::Pane;
use super::pick::{Thing, project};
use super::state::State;
use crate::settings::{Backend, Method};

/// The part of the picture's area where the left picture is seen, or the right one.
fn part_of(area: Rect, state: &State, side: usize) -> Rect {
    if state.right.is_none() || state.heat {
        return if side == 0 { area } else { Rect::NOTHING };
    }
    let divider = area.left() + (state.divider * f64::from(area.width())) as f32;
    let (mut left, mut right) = (area, area);
    *left.right_mut() = divider;
    *right.left_mut() = divider;
    [left, right][side]
}

/// Draws a pane's markers over its part of the area that shows the pictures.
pub fn draw(painter: &Painter, area: Rect, state: &State, side: usize, pane: &Pane) {
    let (Some(frame), Some((markers, size))) = (pane.shown(), pane.markers()) else { return };
    let (camera, part) = (&frame.request.scene.camera, part_of(area, state, side));
    let painter = painter.with_clip_rect(part);
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
    let mut text: Vec<String> =
        shown.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    if state.markers.tiles && markers.tiles.is_none() {
        text.push("no tiles: 2 and 3 gather by them".into());
    }
    let at = part.left_bottom() + vec2(6.0, -6.0);
    label(&painter, at, egui::Align2::LEFT_BOTTOM, &text.join(", "));
}

/// Says on both sides of the divider what is seen there.
pub fn name_sides(painter: &Painter, area: Rect, state: &State) {
    let Some(right) = state.right.filter(|_| !state.heat) else { return };
    let name = |backend: Backend, method: Method| match state.request(false) {
        // Methods are not told apart where passes do not use them.
        Some(request) if request.refines_apart() => backend.name().to_string(),
        _ => format!("{}, {}", backend.name(), method.name()),
    };
    let names = [name(state.backend, state.settings.gather.method), name(right.backend, right.method)];
    let parts = [0, 1].map(|side| part_of(area, state, side));
    for (side, (name, part)) in names.iter().zip(parts).enumerate() {
        let (at, align) = match side {
            0 => (part.right_top() + vec2(-8.0, 8.0), egui::Align2::RIGHT_TOP),
            _ => (part.left_top() + vec2(10.0, 8.0), egui::Align2::LEFT_TOP),
        };
        label(&painter.with_clip_rect(part), at, align, name);
    }
}

/// A ring around every light, which is nothing to see by itself; around `hovered` alone where the panel is closed.
pub fn lights(painter: &Painter, area: Rect, state: &State, hovered: Option<Thing>) {
    let painter = painter.with_clip_rect(area);
    for (i, light) in state.scene.lights.iter().enumerate() {
        let held = hovered == Some(Thing::Light(i));
        if !(held || state.panel) {
            continue;
        }
        let aspect = f64::from(area.width() / area.height());
        let Some((x, y, _)) = project(&state.hand.camera, aspect, light.origin()) else { continue };
        let at = area.min + vec2(x as f32 * area.width(), y as f32 * area.height());
        // Dark and bright, to be seen before anything.
        let radius = if held { 7.0 } else { 5.0 };
        painter.circle_stroke(at, radius + 1.5, Stroke::new(1.5, Color32::from_black_alpha(160)));
        painter.circle_stroke(at, radius, Stroke::new(1.5, Color32::from_rgb(255, 210, 80)));
        if held {
            label(&painter, at + vec2(12.0, 0.0), egui::Align2::LEFT_CENTER, &format!("light {}", i + 1));
        }
    }
}

/// Text that can be read over any picture.
fn label(painter: &Painter, at: Pos2, align: egui::Align2, text: &str) {
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
