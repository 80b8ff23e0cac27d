//! What a worker is asked for, how far it has come with it, and what comes next. No thread in here.

use super::engine::{Engine, FrameReport};
use super::level::{self, Level};
use super::markers;
use super::request::{Key, Request};
use crate::error::Result;
use crate::film::REPLICATES;
use crate::pipeline::progressive::Progressive;

/// How good a picture shall become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// More of the kind is to come: stay within the budget rather than be exact.
    Draft,
    /// One picture of full quality.
    Settled,
    /// So many passes.
    Passes(u32),
}

/// What a worker is to do next.
#[derive(Clone, Debug)]
pub struct Job {
    /// What to show.
    pub request: Request,
    /// How far to go.
    pub goal: Goal,
    /// Photons or cells that are drawn over the picture.
    pub markers: Option<markers::ShownMarkers>,
}

/// What is being drawn.
pub struct Doing {
    /// What for.
    pub job: Job,
    /// Which programs it needs while things move.
    pub key: Key,
    /// A picture of half the resolution and all photons was there.
    halved: bool,
    /// So was a single picture of full quality.
    full: bool,
    /// Sums of the passes so far.
    pub passes: Option<Progressive>,
    /// The error as it was estimated last, and after how many passes.
    error: Option<(u64, f64)>,
    /// It cannot be drawn.
    pub failed: bool,
    /// What is in the mean.
    pub made: Option<FrameReport>,
    /// The picture is right, but it has to be shown once more.
    again: bool,
}

/// What comes next of a job.
pub enum Step {
    /// A single picture.
    Draft(Level),
    /// One more pass.
    Pass,
}

/// Half the resolution, all photons.
const HALF: Level = Level { coarse: level::HALF, fewer: 0, no_gathering: false };
/// Relative error from which passes of final gathering are shown. What they follow is smooth, and off by about two per
/// cent (gi_ref, 200k paths: mean absolute error as after ten passes); noise has to be less than that, since it is seen
/// more easily.
const WORTH_SHOWING: f64 = 0.015;

impl Doing {
    /// Takes a job over; one that asks for the same picture goes on where the last one was.
    pub fn begin(job: Job, last: Option<Doing>) -> Doing {
        match last.filter(|last| last.job.request == job.request && !last.failed) {
            // What is there already is shown anew: other markers may be wanted over it, and a worker that comes back to
            // the front has no other picture to come with.
            Some(last) => Doing { job, again: last.made.is_some(), ..last },
            None => Doing {
                key: job.request.key().clone(),
                job,
                halved: false,
                full: false,
                passes: None,
                error: None,
                failed: false,
                made: None,
                again: false,
            },
        }
    }

    /// Passes so far.
    pub fn passes(&self) -> u64 {
        self.passes.as_ref().map_or(0, Progressive::passes)
    }

    /// The goal is reached, or cannot be.
    pub fn is_done(&self) -> bool {
        self.failed
            || match self.job.goal {
                Goal::Draft => self.made.is_some(),
                Goal::Settled => self.full,
                Goal::Passes(wanted) => self.passes() >= u64::from(wanted),
            }
    }

    /// No pass will follow, because all are in.
    pub fn is_converged(&self) -> bool {
        self.is_done() && !self.failed && matches!(self.job.goal, Goal::Passes(_))
    }

    /// There is nothing left to do.
    pub fn is_idle(&self) -> bool {
        self.is_done() && !self.again
    }

    /// What is there has to be shown once more.
    pub fn take_again(&mut self) -> bool {
        std::mem::take(&mut self.again) && self.is_shown()
    }

    /// What comes next; `ladder`: the level that moving pictures have, `known`: programs are built.
    pub fn next(&self, ladder: Option<Level>, known: bool) -> Option<Step> {
        if self.is_done() {
            return None;
        }
        // Who only makes passes has none of the tables of drafts.
        let apart = self.job.request.refines_apart() && matches!(self.job.goal, Goal::Passes(_));
        Some(match ladder {
            _ if apart || self.passes() > 0 => Step::Pass,
            // The first picture of new programs is coarse, to be there soon; so is what moves.
            Some(level) if self.job.goal == Goal::Draft || !known => Step::Draft(level),
            // Where a whole picture takes long, one of half the resolution comes before it.
            Some(level) if !self.halved && !self.full && level.coarse > HALF.coarse => Step::Draft(HALF),
            _ if matches!(self.job.goal, Goal::Passes(_)) => Step::Pass,
            _ => Step::Draft(Level::FULL),
        })
    }

    /// Whether what was made is shown.
    pub fn is_shown(&self) -> bool {
        let is_better = || self.error.is_some_and(|(_, error)| error <= WORTH_SHOWING);
        !self.job.request.refines_apart() || self.passes() == 0 || self.is_done() || is_better()
    }

    /// Learns what was made.
    pub fn learn(&mut self, made: FrameReport) {
        if made.passes == 0 {
            self.halved |= made.level == HALF;
            self.full |= made.level == Level::FULL;
        }
        self.made = Some(FrameReport { error: self.estimate(), ..made });
    }

    /// One more pass; nothing where it was not wanted any more before it was done.
    ///
    /// # Errors
    /// What the backend meets.
    pub fn pass(&mut self, engine: &mut Engine) -> Result<Option<FrameReport>> {
        let request = &self.job.request;
        let passes = match &mut self.passes {
            Some(passes) => passes,
            None => self.passes.insert(Progressive::new(&request.scene, &request.passes)?),
        };
        engine.pass(request, passes, true)
    }

    /// The relative error, estimated anew now and then: that costs as much as a small pass.
    fn estimate(&mut self) -> Option<f64> {
        let (passes, done) = (self.passes(), self.is_done());
        let due = passes % REPLICATES as u64 == 0 && self.error.is_none_or(|(last, _)| 4 * passes >= 5 * last);
        if passes >= REPLICATES as u64 && (due || done) {
            let estimate = self.passes.as_mut().and_then(Progressive::estimate);
            self.error = estimate.map(|estimate| (passes, estimate.relative));
        }
        self.error.map(|(_, error)| error)
    }
}
