//! Work cut by measured time: no single submission to a device may last so long that a watchdog ends it (drivers give
//! two seconds, displays stutter far below that) or that Ctrl-C seems dead.
//!
//! A piece tells by its time how large the next one may be. What is known of a kernel is kept, so that work which is
//! short anyway goes in one piece.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

/// Milliseconds that a piece should take: well below the 250 that none may exceed.
const AIM: f64 = 75.0;

/// Most that a piece may grow by: what comes next may cost more than what came before.
const GROWTH: f64 = 4.0;

/// Share of the aim that a first piece may take by what is known from last time: the scene may have changed since.
const TRUST: f64 = 0.5;

/// Pieces that unknown work is begun with: the first is this share of all.
const FIRST: usize = 64;

/// What pieces should take, microseconds; 0: [`AIM`].
static AIM_US: AtomicU64 = AtomicU64::new(0);

/// The longest submission since [`reset_longest`], nanoseconds.
static LONGEST_NS: AtomicU64 = AtomicU64::new(0);

/// Sets what pieces should take in this process, milliseconds: tests cut finely with it.
pub fn set_aim(ms: f64) {
    AIM_US.store((ms * 1e3) as u64, Ordering::Relaxed);
}

fn aim() -> f64 {
    match AIM_US.load(Ordering::Relaxed) {
        0 => AIM,
        us => us as f64 / 1e3,
    }
}

/// The longest paced submission of this process since the last [`reset_longest`], milliseconds.
pub fn longest() -> f64 {
    LONGEST_NS.load(Ordering::Relaxed) as f64 / 1e6
}

/// Forgets the longest submission.
pub fn reset_longest() {
    LONGEST_NS.store(0, Ordering::Relaxed);
}

/// What is known of one kernel or shader.
#[derive(Debug, Default)]
pub struct Pace {
    /// Milliseconds a unit, 0 where nothing is known.
    unit: Cell<f64>,
    /// Units of the last piece; 0 before the first of this run.
    last: Cell<usize>,
}

impl Pace {
    /// A new run begins.
    pub fn begin(&self) {
        self.last.set(0);
    }

    /// Forgets what is known: the work has become another.
    pub fn forget(&self) {
        self.unit.set(0.0);
    }

    /// How many units the next piece has, of `left` of `all`; a multiple of `granule` unless it is the last.
    pub fn next(&self, left: usize, all: usize, granule: usize) -> usize {
        let (unit, last) = (self.unit.get(), self.last.get());
        let wanted = match (unit > 0.0, last) {
            (true, 0) => TRUST * aim() / unit,
            (true, last) => (aim() / unit).min(GROWTH * last as f64),
            (false, _) => (all / FIRST) as f64,
        };
        // Beyond usize the conversion saturates, which is right.
        let whole = (wanted as usize / granule).max(1).saturating_mul(granule);
        // A remainder of less than half a piece is not worth one.
        if whole.saturating_add(whole / 2) >= left { left } else { whole }
    }

    /// A piece is done.
    pub fn took(&self, units: usize, ms: f64) {
        self.unit.set(ms.max(1e-6) / units.max(1) as f64);
        self.last.set(units);
        LONGEST_NS.fetch_max((ms * 1e6) as u64, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pieces of a run in which a unit costs what `cost` says; their units and times.
    fn run(pace: &Pace, all: usize, granule: usize, cost: impl Fn(usize) -> f64) -> Vec<(usize, f64)> {
        let (mut done, mut pieces) = (0, Vec::new());
        pace.begin();
        while done < all {
            let units = pace.next(all - done, all, granule);
            assert!(units > 0 && (units % granule == 0 || done + units == all));
            let ms = (done..done + units).map(&cost).sum();
            pace.took(units, ms);
            pieces.push((units, ms));
            done += units;
        }
        assert_eq!(done, all);
        pieces
    }

    #[test]
    fn long_work_is_cut_and_short_work_is_not() {
        let pace = Pace::default();
        // 8 s in all, four times as dear in the middle.
        let pieces = run(&pace, 1000, 1, |unit| if (400..600).contains(&unit) { 20.0 } else { 5.0 });
        // A unit itself takes 20 ms; the step from 75 ms is the worst there can be here.
        assert!(pieces.iter().all(|(_, ms)| *ms <= 330.0), "{pieces:?}");
        assert!(pieces.len() > 50);
        let short = Pace::default();
        assert!(run(&short, 1000, 8, |_| 0.01).len() <= 5);
        assert_eq!(run(&short, 1000, 8, |_| 0.01).len(), 1, "what is known to be short goes in one piece");
        short.forget();
        assert!(run(&short, 1000, 8, |_| 0.01).len() > 1);
    }

    #[test]
    fn a_first_piece_of_unknown_work_is_small() {
        assert_eq!(Pace::default().next(6400, 6400, 10), 100);
        assert_eq!(Pace::default().next(5, 5, 8), 5);
    }
}
