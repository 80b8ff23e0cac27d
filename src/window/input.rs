//! The mouse and the keys of flight: what is held, and what its motion does.

use egui::{Pos2, Rect};
use winit::event::MouseButton;

use super::orbit::Flight;
use super::pick::{self, Held, Place, Thing};
use super::state::State;

/// How near to the divider the mouse takes it, points.
const DIVIDER: f32 = 6.0;

/// What the mouse does while a button is down.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Grip {
    #[default]
    None,
    Orbit,
    Pan,
    Look,
    Divider,
    Thing(Held),
}

/// Mouse and keys of flight.
#[derive(Clone, Debug, Default)]
pub struct Input {
    at: Option<Pos2>,
    grip: Grip,
    button: Option<MouseButton>,
    /// Right, up, forward; each sign's key on its own, so that both at once cancel.
    keys: [[bool; 2]; 3],
}

impl Input {
    /// A key of flight goes down or up.
    pub fn key(&mut self, axis: usize, sign: f64, down: bool) {
        self.keys[axis][usize::from(sign > 0.0)] = down;
    }

    /// Which way the keys fly.
    pub fn flight(&self) -> Flight {
        let [right, up, forward] = self.keys.map(|[less, more]| f64::from(u8::from(more)) - f64::from(u8::from(less)));
        Flight { right, up, forward }
    }

    /// The window lost the keyboard.
    pub fn release_all(&mut self) {
        self.keys = Default::default();
        (self.grip, self.button) = (Grip::None, None);
    }

    /// What the left button has hold of, or would take.
    pub fn over(&self, area: Rect, state: &State) -> Option<Thing> {
        match self.grip {
            Grip::Thing(held) => Some(held.thing),
            Grip::None => {
                let at = self.at.filter(|at| area.contains(*at))?;
                pick::pick(&state.scene_as_seen(), place(at, area)).map(|held| held.thing)
            }
            _ => None,
        }
    }

    /// A button goes down over the picture.
    pub fn pressed(&mut self, button: MouseButton, shift: bool, area: Rect, state: &mut State) {
        let Some(at) = self.at.filter(|at| area.contains(*at)) else { return };
        if self.button.is_some() {
            return; // the first button has the mouse
        }
        let divider = area.left() + state.divider as f32 * area.width();
        self.grip = match button {
            MouseButton::Left if state.right.is_some() && !state.heat && (at.x - divider).abs() <= DIVIDER => {
                Grip::Divider
            }
            MouseButton::Left if shift => Grip::Pan,
            MouseButton::Left => match pick::pick(&state.scene_as_seen(), place(at, area)) {
                Some(held) => {
                    state.held = Some(held.thing);
                    Grip::Thing(held)
                }
                None => Grip::Orbit,
            },
            MouseButton::Middle => Grip::Pan,
            MouseButton::Right => Grip::Look,
            _ => return,
        };
        self.button = Some(button);
    }

    /// A button goes up.
    pub fn released(&mut self, button: MouseButton) {
        if self.button == Some(button) {
            (self.grip, self.button) = (Grip::None, None);
        }
    }

    /// The mouse is elsewhere; whether that changed what is shown.
    pub fn moved(&mut self, to: Pos2, area: Rect, state: &mut State) -> bool {
        let Some(from) = self.at.replace(to) else { return false };
        let height = f64::from(area.height().max(1.0));
        let (right, down) = (f64::from(to.x - from.x) / height, f64::from(to.y - from.y) / height);
        match self.grip {
            Grip::None => return false,
            Grip::Orbit => state.hand.orbit(right, down),
            Grip::Pan => state.hand.pan(right, down),
            Grip::Look => state.hand.look(right, down),
            Grip::Divider => {
                state.divider = f64::from((to.x - area.left()) / area.width().max(1.0)).clamp(0.0, 1.0);
            }
            Grip::Thing(held) => {
                let center = held.center(&state.hand.camera, place(to, area));
                state.edit(|scene| held.thing.put(scene, center));
            }
        }
        true
    }
}

fn place(at: Pos2, area: Rect) -> Place {
    Place {
        x: f64::from((at.x - area.left()) / area.width()),
        y: f64::from((at.y - area.top()) / area.height()),
        aspect: f64::from(area.width() / area.height()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Backend, Settings};
    use egui::pos2;

    fn state() -> State {
        let text = "[camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
                    [[spheres]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n";
        let scene = crate::scene::parse(text, "one.toml").unwrap();
        State::new("one.toml".into(), scene, Settings::default(), Backend::Cpu, Default::default())
    }

    fn drag(input: &mut Input, state: &mut State, button: MouseButton, from: Pos2, to: Pos2) {
        let area = Rect::from_min_max(pos2(0.0, 0.0), pos2(400.0, 300.0));
        input.moved(from, area, state);
        input.pressed(button, false, area, state);
        input.moved(to, area, state);
        input.released(button);
        input.moved(pos2(0.0, 0.0), area, state);
    }

    #[test]
    fn dragging_a_sphere_moves_it_and_dragging_beside_it_orbits() {
        let (mut input, mut state) = (Input::default(), state());
        let camera = state.hand.camera.clone();
        drag(&mut input, &mut state, MouseButton::Left, pos2(200.0, 150.0), pos2(230.0, 150.0));
        assert!(state.scene.shapes.spheres[0].center.x > 0.5 && state.hand.camera == camera);
        assert_eq!(state.held, Some(Thing::Shape(0)));
        let center = state.scene.shapes.spheres[0].center;
        drag(&mut input, &mut state, MouseButton::Left, pos2(20.0, 20.0), pos2(60.0, 20.0));
        assert!(state.scene.shapes.spheres[0].center == center && state.hand.camera != camera);
    }

    #[test]
    fn the_divider_is_taken_before_what_lies_under_it() {
        let (mut input, mut state) = (Input::default(), state());
        state.act(super::super::keys::Action::Split, false);
        drag(&mut input, &mut state, MouseButton::Left, pos2(202.0, 150.0), pos2(300.0, 150.0));
        assert_eq!(state.divider, 0.75);
        assert_eq!(state.scene.shapes.spheres[0].center.x, 0.0);
    }

    #[test]
    fn keys_against_each_other_cancel_and_a_lost_keyboard_stops() {
        let mut input = Input::default();
        input.key(2, 1.0, true);
        input.key(2, -1.0, true);
        assert!(input.flight().is_still());
        input.key(2, -1.0, false);
        assert_eq!(input.flight().forward, 1.0);
        input.release_all();
        assert!(input.flight().is_still());
    }
}
