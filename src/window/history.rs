//! The last frames' times by stage, as a plot.

use std::collections::VecDeque;

use egui::{Color32, Rect, Sense, Ui, pos2, vec2};

use super::engine::FrameReport;

/// Frames that are remembered.
const LENGTH: usize = 120;

/// Stages as the plot stacks them.
const STAGES: [(&str, Color32); 5] = [
    ("upload", Color32::from_rgb(150, 150, 150)),
    ("photons", Color32::from_rgb(240, 190, 70)),
    ("grid", Color32::from_rgb(110, 190, 110)),
    ("tiles", Color32::from_rgb(120, 160, 240)),
    ("trace", Color32::from_rgb(220, 100, 90)),
];

/// Milliseconds by stage of the last frames.
#[derive(Clone, Debug, Default)]
pub struct History {
    frames: VecDeque<[f32; STAGES.len()]>,
}

impl History {
    /// Remembers a frame.
    pub fn push(&mut self, made: &FrameReport) {
        if self.frames.len() == LENGTH {
            self.frames.pop_front();
        }
        let t = &made.times;
        let named = t.upload + t.emit + t.grid + t.tiles + t.compile;
        // What no stage names grows with the pixels, as tracing does.
        let trace = (made.frame_ms - named).max(t.trace);
        self.frames.push_back([t.upload, t.emit, t.grid, t.tiles, trace].map(|ms| ms as f32));
    }

    /// Draws the times of recent frames as a plot.
    pub fn plot(&self, ui: &mut Ui) {
        let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 64.0), Sense::hover());
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 2.0, Color32::from_gray(16));
        let total = |frame: &[f32; STAGES.len()]| frame.iter().sum::<f32>();
        let highest = self.frames.iter().map(total).fold(1.0, f32::max);
        let step = rect.width() / LENGTH as f32;
        for (i, frame) in self.frames.iter().enumerate() {
            let left = rect.left() + i as f32 * step;
            let mut bottom = rect.bottom();
            for (ms, (_, color)) in frame.iter().zip(STAGES) {
                let top = bottom - ms / highest * rect.height();
                painter.rect_filled(Rect::from_min_max(pos2(left, top), pos2(left + step, bottom)), 0.0, color);
                bottom = top;
            }
        }
        let font = egui::FontId::proportional(10.0);
        let text = format!("{highest:.0} ms");
        painter.text(rect.left_top() + vec2(2.0, 1.0), egui::Align2::LEFT_TOP, text, font, Color32::WHITE);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 6.0;
            for (name, color) in STAGES {
                ui.label(egui::RichText::new(name).color(color).small());
            }
        });
    }
}
