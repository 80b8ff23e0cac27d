//! Painting the window: the picture, what is drawn over it, the panel, the title.

use std::sync::Arc;

use winit::dpi::PhysicalSize;

use super::open::Open;
use super::pane::Pane;
use super::summary::Summary;
use super::{overlay, panel};
use crate::device::gl::Shown;
use crate::error::Result;

impl Open {
    /// Paints the window; false where a worker has the driver just now.
    ///
    /// # Errors
    /// [`crate::error::Error::Driver`] when the surface is gone.
    pub fn paint(&mut self, summary: &mut Summary) -> Result<bool> {
        let driver_lock = Arc::clone(&self.terms.driver_lock);
        let Some(_held) = driver_lock.try_take() else { return Ok(false) };
        let window = Arc::clone(&self.windowed.window);
        let PhysicalSize { width, height } = window.inner_size();
        let mut asked = None;
        let mut area = self.area;
        let (state, panes, input) = (&mut self.state, &self.panes, &self.input);
        let facts = panel::Facts {
            frames: [0, 1].map(|side| panes[side].as_ref().and_then(Pane::shown)),
            building: [0, 1].map(|side| panes[side].as_ref().is_some_and(Pane::is_building)),
            history: &self.history,
            rate: self.painted_at.len() as f64,
            recording: self.recording.is_on(),
        };
        self.egui.run(&window, |ui| {
            if state.panel {
                egui::Panel::right("panel").exact_size(panel::WIDTH).resizable(false).show(ui, |ui| {
                    asked = asked.or(panel::show(ui, state, &facts));
                });
            }
            area = ui.available_rect_before_wrap();
            for (side, pane) in panes.iter().enumerate() {
                pane.iter().for_each(|pane| overlay::draw(ui.painter(), area, state, side, pane));
            }
            overlay::name_sides(ui.painter(), area, state);
            let hovered = if ui.ctx().egui_wants_pointer_input() { None } else { input.over(area, state) };
            overlay::lights(ui.painter(), area, state, hovered);
            if hovered.is_some() {
                ui.ctx().set_cursor_icon(egui::CursorIcon::Grab);
            }
            if state.help {
                panel::help(ui, &mut state.help);
            }
        });
        self.area = area;
        self.present.clear(width, height);
        let scale = self.egui.egui_ctx.pixels_per_point();
        let [left, top, right, bottom] =
            [area.left(), area.top(), area.right(), area.bottom()].map(|x| (x * scale).round() as i32);
        let textures = [0, 1].map(|side| self.panes[side].as_ref().and_then(Pane::texture));
        if let [Some(texture), other] = textures {
            self.present.draw(&Shown {
                left: texture,
                right: other,
                heat: self.state.heat,
                divider: (self.state.divider * f64::from(right - left)).round() as f32,
                area: [left, height as i32 - bottom, right - left, bottom - top],
                exposure: self.state.exposure,
                tone_map: self.state.tone_map,
            });
        }
        self.egui.paint(&window);
        self.windowed.swap()?;
        let title = self.describe();
        if title != self.title {
            window.set_title(&title);
            self.title = title;
        }
        if let Some(action) = asked {
            self.act(action, false, summary);
        }
        Ok(true)
    }

    fn describe(&self) -> String {
        let mut title = format!("Photile: {} ({}", self.state.scene.name, self.state.backend.name());
        let frame = self.panes[0].as_ref().and_then(Pane::shown);
        if frame.is_some_and(|frame| frame.made.host_photons) {
            title += ", photons from the CPU: no OpenCL";
        }
        if self.state.paused {
            title += ", paused";
        }
        // Of what was asked for last, in all pictures.
        let done = self.panes.iter().zip(&self.asked).all(|(pane, asked)| match (pane, asked) {
            (Some(pane), Some((asked, _))) => {
                pane.shown().is_some_and(|frame| frame.converged && frame.request == *asked && !pane.is_building())
            }
            (pane, _) => pane.is_none(),
        });
        if done {
            title += ", converged";
        }
        title + ")"
    }
}
