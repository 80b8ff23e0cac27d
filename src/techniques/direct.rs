//! Direct light: what the lights send straight to what is seen, by shadow rays. No photons at all.

use super::{Place, Row, Stages, Task, Wish};
use crate::error::Result;
use crate::scene::Scene;
use crate::settings::Settings;
use crate::stage::Stage;
use crate::stage::trace::{Indirect, Permutation, Trace};

/// What it says of itself. Passes differ in where their samples lie, and their spread is all of their error.
pub static ROW: Row = Row {
    name: "direct",
    stages: &[Stage::Upload, Stage::Compile, Stage::Trace],
    tables: &[],
    settle: |_: &Wish, _: &Scene, _: &mut Settings| Ok(()),
    of_pass: |_, _, _| (),
    bias: None,
    open: |_: &Place| Ok(Box::new(Direct)),
};

/// Holds nothing.
struct Direct;

impl Stages for Direct {
    fn run(&mut self, _: Stage, _: &mut Task, _: &mut dyn Trace) -> Result<bool> {
        Ok(false)
    }

    fn permutation(&self, task: &Task) -> Permutation {
        Permutation { features: task.features, gathering: None, final_gather: None }
    }

    fn trace(&self, task: &Task, tracer: &mut dyn Trace) -> Result<()> {
        tracer.trace(&task.frame, Indirect::None)
    }
}
