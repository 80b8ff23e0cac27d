//! The panel: camera, lights, materials, photons, gathering, what is shown, and what it costs.

use egui::{CollapsingHeader, Color32, DragValue, RichText, Ui};
use glam::DVec3;

use super::exchange::Frame;
use super::history::History;
use super::keys::{Action, GESTURES, TABLE};
use super::state::{Right, State};
use crate::device::gl::ToneMap;
use crate::materials::Material;
use crate::settings::{Amount, Backend, Choice, LightMode, Method, Technique, TechniqueKind};
use crate::techniques::default_technique;

/// The panel's width, points.
pub const WIDTH: f32 = 290.0;

/// What the panel tells besides the state.
pub struct Facts<'a> {
    /// The pictures shown, left and right.
    pub frames: [Option<&'a Frame>; 2],
    /// Programs are being built for them.
    pub building: [bool; 2],
    /// Times of the last frames.
    pub history: &'a History,
    /// Frames a second, of pictures that changed.
    pub rate: f64,
    /// Keys are being recorded.
    pub recording: bool,
}

/// Draws the panel; what buttons ask for.
pub fn show(ui: &mut Ui, state: &mut State, facts: &Facts) -> Option<Action> {
    let mut asked = None;
    messages(ui, state);
    ui.horizontal_wrapped(|ui| {
        let changed = state.is_changed();
        for (label, action, enabled) in [
            ("Save", Action::Save, changed),
            ("Reset view", Action::Reset, true),
            ("Screenshot", Action::Screenshot, true),
            ("Split", Action::Split, true),
            ("Heat map", Action::HeatMap, true),
            (if facts.recording { "Stop" } else { "Record" }, Action::Record, true),
            ("Help", Action::Help, true),
        ] {
            if ui.add_enabled(enabled, egui::Button::new(label)).clicked() {
                asked = Some(action);
            }
        }
    });
    ui.separator();
    egui::ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        let before = (state.settings.gather, state.right, state.settings.photons.amount);
        section(ui, "Picture", true, |ui| picture(ui, state));
        section(ui, "Photons and gathering", true, |ui| photons(ui, state));
        let methods = [before.1, state.right].map(|right| right.map(|right| right.method));
        if before.0 != state.settings.gather || methods[0] != methods[1] {
            state.gather_asked();
        }
        state.wish.photons |= before.2 != state.settings.photons.amount;
        section(ui, "Overlay", true, |ui| {
            ui.checkbox(&mut state.markers.photons, "photons");
            ui.checkbox(&mut state.markers.cells, "cells of the grid");
            ui.checkbox(&mut state.markers.tiles, "tiles, by photons listed");
        });
        section(ui, "Stages", true, |ui| stages(ui, facts));
        section(ui, "Camera", false, |ui| camera(ui, state));
        section(ui, "Lights", false, |ui| lights(ui, state));
        section(ui, "Materials", false, |ui| materials(ui, state));
    });
    asked
}

fn section(ui: &mut Ui, title: &str, open: bool, add: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(title).default_open(open).show(ui, add);
}

fn messages(ui: &mut Ui, state: &State) {
    let red = Color32::from_rgb(255, 120, 110);
    for text in [&state.file_error, &state.failure].into_iter().flatten() {
        ui.label(RichText::new(text).color(red));
    }
    if let Some(notice) = &state.notice {
        ui.label(RichText::new(notice).weak());
    }
}

/// A list to choose from, by name.
fn choice_box<T: Choice>(ui: &mut Ui, id: &str, width: f32, chosen: &mut T) {
    egui::ComboBox::from_id_salt(id).selected_text(chosen.row().name).width(width).show_ui(ui, |ui| {
        for row in T::offered() {
            ui.selectable_value(chosen, row.value, row.name);
        }
    });
}

/// Who makes a picture.
fn maker(ui: &mut Ui, side: &str, backend: &mut Backend, method: &mut Method) {
    ui.horizontal(|ui| {
        ui.label(side);
        choice_box(ui, &format!("{side} backend"), 70.0, backend);
        choice_box(ui, &format!("{side} method"), 80.0, method);
    });
}

fn picture(ui: &mut Ui, state: &mut State) {
    maker(ui, "left", &mut state.backend, &mut state.settings.gather.method);
    if let Some(Right { backend, method }) = &mut state.right {
        maker(ui, "right", backend, method);
    }
    ui.horizontal(|ui| {
        ui.label("light");
        for row in LightMode::offered() {
            ui.selectable_value(&mut state.settings.light, row.value, row.name);
        }
    });
    at_rest(ui, state);
    ui.add(egui::Slider::new(&mut state.exposure, -10.0..=10.0).text("exposure, EV"));
    ui.horizontal(|ui| {
        ui.label("tone map");
        for map in ToneMap::ALL {
            ui.selectable_value(&mut state.tone_map, map, map.name());
        }
    });
    ui.horizontal(|ui| {
        ui.add(DragValue::new(&mut state.passes).range(1..=4096));
        ui.label("passes");
        ui.checkbox(&mut state.paused, "pause");
    });
}

/// How passes are made.
fn at_rest(ui: &mut Ui, state: &mut State) {
    let name = |kind: Option<TechniqueKind>| kind.map_or("automatic", |kind| kind.row().title);
    // Where it is not to be had, density estimates take its place.
    let suits = matches!(default_technique(&state.scene, &state.settings), Technique::FinalGather(_));
    ui.horizontal(|ui| {
        ui.label("at rest");
        egui::ComboBox::from_id_salt("at rest").selected_text(name(state.wish.kind)).show_ui(ui, |ui| {
            for kind in std::iter::once(None).chain(TechniqueKind::ALL.map(Some)) {
                ui.add_enabled_ui(suits || kind != Some(TechniqueKind::FinalGather), |ui| {
                    ui.selectable_value(&mut state.wish.kind, kind, name(kind));
                });
            }
        });
    });
}

fn photons(ui: &mut Ui, state: &mut State) {
    let settings = &mut state.settings;
    ui.horizontal(|ui| {
        let (count, what) = match &mut settings.photons.amount {
            Amount::Paths(count) => (count, "paths a pass"),
            Amount::Stored(count) => (count, "photons stored"),
        };
        let speed = (f64::from(*count) / 100.0).max(1.0);
        ui.add(DragValue::new(count).range(1..=4_000_000).speed(speed));
        ui.label(what);
    });
    ui.horizontal(|ui| {
        let mut chosen = settings.gather.radius.is_none();
        ui.checkbox(&mut chosen, "radius chosen");
        let radius = settings.gather.radius.get_or_insert(0.5);
        let speed = f64::from(*radius) / 100.0;
        ui.add_enabled(!chosen, DragValue::new(radius).range(1e-6..=1e6).speed(speed).suffix(" m"));
        if chosen {
            settings.gather.radius = None;
        }
    });
    ui.horizontal(|ui| {
        let mut own = settings.gather.cells.is_some();
        ui.checkbox(&mut own, "grid");
        let mut cells = settings.gather.cells.unwrap_or([60, 40, 40]);
        for count in &mut cells {
            ui.add_enabled(own, DragValue::new(count).range(1..=500));
        }
        settings.gather.cells = own.then_some(cells);
    });
    ui.horizontal(|ui| {
        let mut own = settings.gather.tile.is_some();
        ui.checkbox(&mut own, "tile");
        let mut tile = settings.gather.tile.unwrap_or(crate::plan::tiling::TILE);
        for side in &mut tile {
            ui.add_enabled(own, DragValue::new(side).range(4..=1024).suffix(" px"));
        }
        settings.gather.tile = own.then_some(tile);
    });
    if settings.gather.method == Method::Knn {
        ui.horizontal(|ui| {
            ui.add(DragValue::new(&mut settings.gather.nearest).range(1..=crate::program::gathering::MAX_NEAREST));
            ui.label("nearest photons");
        });
    }
}

fn stages(ui: &mut Ui, facts: &Facts) {
    for (frame, building) in facts.frames.into_iter().zip(facts.building) {
        let Some(frame) = frame else { continue };
        let made = &frame.made;
        let [width, height] = made.size;
        let name = made.backend.map_or("", Backend::name);
        let state = match (frame.converged, made.passes) {
            (_, 0) => "draft".to_string(),
            (true, passes) => format!("converged, {passes} passes"),
            (false, passes) => format!("pass {passes}"),
        };
        ui.label(RichText::new(format!("{name}: {width} × {height}, {}, {state}", made.level.describe())).strong());
        if let Some(error) = made.error {
            ui.label(format!("relative error about {:.2} %", 100.0 * error));
        }
        if building {
            ui.label("building programs …");
        }
        if let Some(photons) = made.photons {
            ui.label(match (made.technique, made.radius) {
                (Technique::FinalGather(gather), _) => {
                    format!("{} paths, final gathering, {} rays a site", photons.emitted, gather.rays)
                }
                (_, radius) => {
                    let method = made.method.map_or("", Method::name);
                    format!("{} photons stored, {method}, R = {:.3} m", photons.stored, radius.unwrap_or(0.0))
                }
            });
        }
        let t = &made.times;
        let named = [
            ("compile", t.compile),
            ("upload", t.upload),
            ("photons", t.emit),
            ("grid", t.grid),
            ("tiles", t.tiles),
            ("trace", t.trace),
        ];
        let ran = named.iter().filter(|(_, ms)| *ms > 0.0).map(|(name, ms)| format!("{name} {ms:.1}"));
        ui.label(format!("ran: {} ms", ran.collect::<Vec<_>>().join(", ")));
        ui.label(RichText::new(format!("{:.1} ms a frame, {} MB", made.frame_ms, made.bytes / 1_000_000)).weak());
    }
    facts.history.plot(ui);
    ui.label(format!("{:.0} pictures a second", facts.rate));
}

fn vector(ui: &mut Ui, label: &str, v: &mut DVec3, speed: f64) -> bool {
    ui.horizontal(|ui| {
        let mut changed = false;
        for axis in 0..3 {
            changed |= ui.add(DragValue::new(&mut v[axis]).speed(speed).max_decimals(3)).changed();
        }
        ui.label(label);
        changed
    })
    .inner
}

fn camera(ui: &mut Ui, state: &mut State) {
    let before = state.hand.camera.clone();
    let camera = &mut state.hand.camera;
    vector(ui, "position", &mut camera.position, 0.02);
    vector(ui, "look at", &mut camera.look_at, 0.02);
    ui.add(egui::Slider::new(&mut camera.fov_y, 5.0..=150.0).text("field of view, °"));
    // A camera that looks nowhere, or straight along up, has no picture.
    let view = camera.look_at - camera.position;
    if view.length() < 1e-9 || view.normalize().cross(camera.up.normalize()).length() < 1e-4 {
        *camera = before;
    }
}

fn lights(ui: &mut Ui, state: &mut State) {
    state.edit(|scene| {
        for (i, light) in scene.lights.points.iter_mut().enumerate() {
            ui.label(format!("light {}", i + 1));
            vector(ui, "position", &mut light.position, 0.02);
            let strongest = light.intensity.max_element().max(1e-3);
            vector(ui, "W/sr", &mut light.intensity, strongest / 100.0);
            light.intensity = light.intensity.clamp(DVec3::ZERO, DVec3::splat(1e30));
        }
    });
    if state.scene.lights.is_empty() {
        ui.label("none");
    }
}

fn materials(ui: &mut Ui, state: &mut State) {
    state.edit(|scene| scene.materials.iter_mut().for_each(|one| material(ui, one)));
}

fn material(ui: &mut Ui, material: &mut Material) {
    let name = material.name.clone();
    ui.push_id(&name, |ui| {
        ui.horizontal(|ui| {
            let mut color = material.color.as_vec3().to_array();
            if ui.color_edit_button_rgb(&mut color).changed() {
                material.color = color.map(|c| f64::from(c).clamp(0.0, 1.0)).into();
            }
            ui.label(&name);
        });
        // Shares of what arrives: one gives way to the other, so that no more leaves.
        let most = 1.0 - material.transmission;
        if ui.add(egui::Slider::new(&mut material.diffuse, 0.0..=most).text("diffuse")).changed() {
            material.specular = material.specular.min(most - material.diffuse).max(0.0);
        }
        if ui.add(egui::Slider::new(&mut material.specular, 0.0..=most).text("specular")).changed() {
            material.diffuse = material.diffuse.min(most - material.specular).max(0.0);
            if material.specular > 0.0 && material.roughness == 0.0 {
                material.roughness = 0.2;
            }
        }
        if material.specular > 0.0 {
            ui.add(egui::Slider::new(&mut material.roughness, 0.02..=1.0).text("roughness"));
        }
        ui.add(egui::Slider::new(&mut material.ambient, 0.0..=1.0).text("ambient"));
    });
}

/// The window of F1.
pub fn help(ui: &Ui, open: &mut bool) {
    egui::Window::new("Keys and mouse").open(open).resizable(false).vscroll(true).show(ui.ctx(), |ui| {
        egui::Grid::new("keys").striped(true).show(ui, |ui| {
            let keys = TABLE.iter().map(|binding| (binding.key, &*binding.does));
            for (key, what) in GESTURES.iter().copied().chain(keys) {
                ui.label(RichText::new(key).strong());
                ui.label(what);
                ui.end_row();
            }
        });
    });
}
