//! What the user does: keys, mouse, and what they ask for.

use std::io::Write as _;
use std::sync::Arc;

use winit::event::{ElementState, MouseScrollDelta, WindowEvent};
use winit::keyboard::NamedKey;

use super::keys::{self, Action};
use super::open::Open;
use super::save;
use super::state::Effect;
use super::summary::Summary;
use crate::error::{Error, Result};
use crate::film::write_beside;
use crate::scene;

impl Open {
    /// Takes an event; whether the window shall close.
    pub fn handle(&mut self, event: &WindowEvent, summary: &mut Summary) -> bool {
        // Tab would give the panel's widgets the keyboard, one after the other.
        let tab = matches!(event, WindowEvent::KeyboardInput { event: key, .. } if key.logical_key == NamedKey::Tab);
        if !tab {
            self.wants_paint |= self.egui.on_window_event(&self.windowed.window, event).repaint;
        }
        let (over_panel, typing) =
            (self.egui.egui_ctx.egui_wants_pointer_input(), self.egui.egui_ctx.text_edit_focused());
        match event {
            WindowEvent::CloseRequested => return true,
            WindowEvent::Resized(size) => {
                self.windowed.resize(size.width, size.height);
                let scale = self.windowed.window.scale_factor();
                self.fitted = self.fitted.filter(|fitted| fitted.size(scale) == *size);
                self.visible = size.width > 0 && size.height > 0;
                self.wants_paint = true;
            }
            WindowEvent::ScaleFactorChanged { scale_factor, inner_size_writer } => {
                // Wayland tells the scale once the window is there: it opened with the panel's size at another one.
                if let Some(fitted) = self.fitted {
                    let size = fitted.size(*scale_factor);
                    // Refused where the size is not the window's to choose; then it stays as it is.
                    let _ = inner_size_writer.clone().request_inner_size(size);
                }
                self.wants_paint = true;
            }
            WindowEvent::Occluded(hidden) => {
                self.visible = !hidden;
                self.wants_paint = true;
            }
            // Keys that go up elsewhere are not seen here.
            WindowEvent::Focused(false) => self.input.release_all(),
            WindowEvent::ModifiersChanged(modifiers) => self.modifiers = modifiers.state(),
            WindowEvent::KeyboardInput { event: key, .. } => {
                let down = key.state == ElementState::Pressed;
                let control = self.modifiers.control_key();
                if let Some((axis, sign)) = keys::flight(key.physical_key).filter(|_| !control && (!typing || !down)) {
                    self.input.key(axis, sign, down);
                }
                if down && !key.repeat && !typing {
                    let shift = self.modifiers.shift_key();
                    let action = keys::digit(key.physical_key).filter(|_| !control);
                    if let Some(action) = action.or_else(|| keys::action(&key.logical_key, control)) {
                        return self.act(action, shift, summary);
                    }
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                let scale = self.egui.egui_ctx.pixels_per_point();
                let at = egui::pos2(position.x as f32 / scale, position.y as f32 / scale);
                if self.input.moved(at, self.area, &mut self.state) {
                    self.wants_paint = true;
                }
            }
            WindowEvent::MouseInput { state: ElementState::Pressed, button, .. } if !over_panel => {
                self.input.pressed(*button, self.modifiers.shift_key(), self.area, &mut self.state);
            }
            WindowEvent::MouseInput { state: ElementState::Released, button, .. } => self.input.released(*button),
            WindowEvent::MouseWheel { delta, .. } if !over_panel => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, y) => f64::from(*y),
                    MouseScrollDelta::PixelDelta(by) => by.y / 50.0,
                };
                self.state.hand.dolly(notches);
            }
            _ => {}
        }
        false
    }

    /// Does what a key or a button asks for; whether the window shall close.
    pub fn act(&mut self, action: Action, shift: bool, summary: &mut Summary) -> bool {
        self.wants_paint = true;
        summary.actions.push(format!("{action:?}"));
        match self.state.act(action, shift) {
            Effect::None => {}
            Effect::Quit => return true,
            Effect::Screenshot => {
                if let Some(pane) = &self.panes[0] {
                    pane.save(self.screenshot.clone(), self.state.exposure);
                }
            }
            Effect::Save => match self.save() {
                Ok(()) => {
                    self.state.notice = Some(format!("saved: {}", self.state.path.display()));
                    summary.written.push(self.state.path.clone());
                }
                Err(error) => self.state.failure = Some(error.to_string()),
            },
            Effect::Record => self.record(summary),
        }
        false
    }

    /// Writes the edits into the scene file.
    fn save(&mut self) -> Result<()> {
        let path = self.state.path.clone();
        let failed = |what: String| Error::File { path: path.clone(), what };
        let text = std::fs::read_to_string(&path).map_err(|error| failed(format!("cannot read: {error}")))?;
        // What somebody else wrote meanwhile must not be undone by what the window remembers.
        let on_disk = scene::load(&path)?;
        let new = self.state.to_save();
        let text = save::updated(&text, &on_disk, &new)?;
        let written = scene::parse(&text, &path.display().to_string())?;
        write_beside(&path, |file| file.write_all(text.as_bytes()))?;
        self.watch.acknowledge();
        self.state.saved = Arc::new(written);
        // The numbers as they were written, so that nothing differs from the file.
        self.state.hand.camera = self.state.saved.camera.clone();
        self.state.first_settings = self.state.settings.clone();
        self.state.scene = Arc::clone(&self.state.saved);
        Ok(())
    }

    /// Begins to record, or ends and writes the file.
    pub fn record(&mut self, summary: &mut Summary) {
        match self.recording.toggle(&self.state.scene) {
            Ok(None) => {}
            Ok(Some(path)) => {
                self.state.notice = Some(format!("recorded: {}", path.display()));
                summary.written.push(path);
            }
            Err(error) => self.state.failure = Some(error.to_string()),
        }
    }
}
