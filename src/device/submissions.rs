//! Work cut by measured time: no single submission to a device may last so long that a watchdog ends it (drivers give
//! two seconds, displays stutter far below that) or that Ctrl-C seems dead.
//!
//! A piece tells by its time how large the next one may be. What is known of a kernel is kept, so that work which is
//! short anyway goes in one piece.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Milliseconds that a piece should take: well below the 250 that none may exceed.
const AIM: f64 = 75.0;

/// Most that a piece may grow by: what comes next may cost more than what came before.
const GROWTH: f64 = 4.0;

/// Share of the aim that a first piece may take by what is known from last time: the scene may have changed since.
const TRUST: f64 = 0.5;

/// Pieces that unknown work is begun with: the first is this share of all.
const FIRST: usize = 64;

/// Most work-items of a first piece of unknown work: a fraction of what a large GPU holds at once, so that it takes
/// about as long as a single work-item does.
const FIRST_ITEMS: usize = 1 << 16;

/// A piece as large as half of what the rate was measured by replaces it, whatever it says; a smaller one, whose start
/// weighs more, only if it is faster or takes this share of the aim.
const SLOW: f64 = 0.125;

/// What pieces should take, microseconds; 0: [`AIM`].
static AIM_US: AtomicU64 = AtomicU64::new(0);

/// Whether kernels are cut on CPUs too, where no watchdog waits.
static EVERYWHERE: AtomicBool = AtomicBool::new(false);

/// The longest submission since [`reset_longest`]: milliseconds, and what it was.
static LONGEST: Mutex<(f64, String)> = Mutex::new((0.0, String::new()));

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

/// For tests: kernels that only GPUs need cut are cut on every device.
pub fn set_everywhere(on: bool) {
    EVERYWHERE.store(on, Ordering::Relaxed);
}

/// Whether all kernels of a device are cut.
pub fn cuts_all(is_gpu: bool) -> bool {
    is_gpu || EVERYWHERE.load(Ordering::Relaxed)
}

/// The longest submission known of since the last [`reset_longest`]: milliseconds, and the kernel's or shader's name.
pub fn longest() -> (f64, String) {
    LONGEST.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Forgets the longest submission.
pub fn reset_longest() {
    *LONGEST.lock().unwrap_or_else(PoisonError::into_inner) = Default::default();
}

/// What is known of one kernel or shader.
#[derive(Debug, Default)]
pub struct Pace {
    name: String,
    /// Milliseconds a unit, 0 where nothing is known.
    unit: Cell<f64>,
    /// What a unit has to do, as was said last.
    work: Cell<f64>,
    /// Units of the piece that told.
    told_by: Cell<usize>,
    /// Units of the last piece; 0 before the first of this run.
    last: Cell<usize>,
}

impl Pace {
    /// Of something of this name, of which nothing is known.
    pub fn new(name: &str) -> Pace {
        Pace { name: name.into(), ..Pace::default() }
    }

    /// A new run begins.
    pub fn begin(&self) {
        self.last.set(0);
    }

    /// Forgets what is known: the work has become another.
    pub fn forget(&self) {
        self.unit.set(0.0);
    }

    /// Says how much a unit has to do now, in whatever measure: what is known follows it.
    pub fn expect(&self, work: f64) {
        match work / self.work.replace(work) {
            0.25..=1.0 => {}
            // What lasts 16 times as long is other work.
            factor if factor > 1.0 && factor <= 16.0 => self.unit.set(self.unit.get() * factor),
            _ => self.forget(),
        }
    }

    /// Whether so many units are known to be short enough for one piece.
    pub fn fits(&self, units: usize) -> bool {
        let unit = self.unit.get();
        unit > 0.0 && units as f64 * unit <= TRUST * aim()
    }

    /// How many units of `width` work-items each the next piece has, of `left` of `all`; a multiple of `granule` unless
    /// it is the last.
    pub fn next(&self, left: usize, all: usize, granule: usize, width: usize) -> usize {
        let (unit, last) = (self.unit.get(), self.last.get());
        let wanted = match (unit > 0.0, last) {
            (true, 0) => TRUST * aim() / unit,
            (true, last) => (aim() / unit).min(GROWTH * last as f64),
            (false, _) => (all / FIRST).min(FIRST_ITEMS / width.max(1)) as f64,
        };
        // Beyond usize the conversion saturates, which is right.
        let whole = (wanted as usize / granule).max(1).saturating_mul(granule);
        // A remainder of less than half a piece is not worth one.
        if whole.saturating_add(whole / 2) >= left { left } else { whole }
    }

    /// A piece is done.
    pub fn took(&self, units: usize, ms: f64) {
        let unit = ms.max(1e-6) / units.max(1) as f64;
        let known = self.unit.get();
        if known == 0.0 || unit <= known || 2 * units >= self.told_by.get() || ms > SLOW * aim() {
            self.unit.set(unit);
            self.told_by.set(units);
        }
        self.last.set(units);
        let mut longest = LONGEST.lock().unwrap_or_else(PoisonError::into_inner);
        if ms > longest.0 {
            *longest = (ms, self.name.clone());
        }
    }
}

/// An order of `count` bands in which neighbours come from all over: every stretch of it is a fair sample. The factor by
/// which a band's number is multiplied, modulo their count.
pub fn stride(count: usize) -> usize {
    let coprime = |stride: &usize| gcd(*stride, count) == 1;
    // The golden ratio spreads any stretch of multiples evenly (Knuth, TAOCP 3, §6.4).
    let wanted = (count as f64 * 0.618_034).round().max(1.0) as usize;
    (wanted..).find(coprime).unwrap_or(1)
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pieces of a run in which a unit costs what `cost` says; their units and times.
    fn run(pace: &Pace, all: usize, granule: usize, cost: impl Fn(usize) -> f64) -> Vec<(usize, f64)> {
        let (mut done, mut pieces) = (0, Vec::new());
        pace.begin();
        while done < all {
            let units = pace.next(all - done, all, granule, 1);
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
        assert_eq!(Pace::default().next(6400, 6400, 10, 1), 100);
        assert_eq!(Pace::default().next(5, 5, 8, 1), 5);
        assert_eq!(Pace::default().next(1 << 20, 1 << 20, 8, 8192), 8, "so wide that few units are many work-items");
    }

    #[test]
    fn a_short_launch_of_few_does_not_spoil_what_a_long_one_told() {
        let pace = Pace::default();
        pace.took(1_000_000, 10.0);
        pace.took(1, 0.01);
        assert!(pace.fits(1_000_000));
        pace.took(1, 20.0);
        assert!(!pace.fits(1_000_000), "one that lasts must be believed");
    }

    #[test]
    fn known_times_follow_the_work() {
        let pace = Pace::default();
        pace.expect(5.0);
        pace.took(1000, 1.0);
        assert!(pace.fits(30_000));
        pace.expect(10.0);
        assert!(pace.fits(10_000) && !pace.fits(20_000));
        pace.expect(10.0);
        assert!(pace.fits(10_000), "the same once more");
        pace.expect(1000.0);
        assert!(!pace.fits(1), "other work is unknown work");
    }

    #[test]
    fn strides_visit_every_band_once_and_spread_them() {
        for count in 1..600 {
            let stride = stride(count);
            let mut order: Vec<usize> = (0..count).map(|band| band * stride % count).collect();
            // Any eighth of the order, of eight bands or more, has some of every quarter.
            if count >= 64 {
                for stretch in order.chunks_exact(count / 8) {
                    for quarter in 0..4 {
                        let within = |band: &&usize| (quarter * count / 4..(quarter + 1) * count / 4).contains(*band);
                        assert!(stretch.iter().any(|band| within(&band)), "{count}: {stretch:?}");
                    }
                }
            }
            order.sort_unstable();
            assert!(order.into_iter().eq(0..count), "{count}");
        }
    }
}
