//! The frame budget: which quality a frame may have so that it is done in time. No clock in here, only milliseconds.

use std::time::Duration;

use super::level::{COARSE, FEWER, HALF, Level};
use super::recent_costs::{JUDGED, RecentCosts};

/// Milliseconds that a frame may take on a GPU, and in software.
const BUDGETS: [f64; 2] = [33.0, 100.0];

/// How long a frame may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// One of [`BUDGETS`].
    Usual,
    /// As many milliseconds as the user asked for.
    Ms(f64),
    /// However long full quality takes.
    None,
}

impl Budget {
    /// Milliseconds, by whether OpenGL is software.
    pub fn ms(self, is_software: bool) -> Option<f64> {
        match self {
            Budget::Usual => Some(BUDGETS[usize::from(is_software)]),
            Budget::Ms(ms) => Some(ms),
            Budget::None => None,
        }
    }
}

/// Rungs that the first picture begins at.
const START: Level = Level { coarse: 16, fewer: 3, no_gathering: false };
/// A step up is taken where frames will take this share of the budget: what is just affordable would fall back at once.
const ROOM: f64 = 0.8;
/// And a step down where they take more than this: what a frame takes varies.
const SNUG: f64 = 0.9;
/// A step up is taken after so many frames that had room.
const PATIENCE: u32 = 4;
/// A step up makes frames dearer by so much at most: what the next rungs cost is a guess.
const GROWTH: f64 = 4.0;
/// What takes so many times what it may is believed at once.
const FAR: f64 = 2.0;
/// Photons may take this share of the budget, where they are made anew for every frame.
const PHOTON_SHARE: f64 = 0.5;
/// Where fewer photons take more than this share of what more of them took, they are not what it costs.
const FIXED: f64 = 0.8;
/// More photons are worth it as long as pixels are no coarser than this with them, and fewer from where pixels are
/// coarser than that. On gi_ref (640 × 480, 200k paths, displayed values of 0 to 255 against a converged picture) a
/// tenth of the photons has an error of 4.6 at full resolution and 4.8 at half; half of the photons has 3.2 there.
const WORTH: [usize; 2] = [HALF, 12];

/// What a frame took, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Making, sorting and moving photons; 0 where the last frame's were kept.
    pub photons: f64,
    /// Tracing and gathering, and all else that grows with pixels.
    pub pixels: f64,
}

/// Steps down as soon as it must, and up with patience.
#[derive(Clone, Debug)]
pub struct Ladder {
    /// Milliseconds that a frame may take.
    pub budget: f64,
    level: Level,
    /// What pixels would take at full resolution, with as many photons as there are.
    full: RecentCosts,
    /// What making all photons would take.
    made: RecentCosts,
    roomy: u32,
    roomy_photons: u32,
    /// Frames that took too long though nothing but gathering is left to drop.
    slow: u32,
    /// The last step down in photons: from where, and what they took there.
    fewer_from: Option<(usize, f64)>,
    /// Fewer photons take no less: what they take are the driver's own costs.
    photons_fixed: bool,
}

/// The coarsest rung.
const LAST: usize = COARSE.len() - 1;

/// The finest rung where pixels that take `full` ms at full resolution take no more than `left`.
fn finest(full: f64, left: f64) -> Option<usize> {
    COARSE.iter().position(|coarse| full / coarse.powi(2) <= left)
}

impl Ladder {
    /// Starts low: the first frame shall be there soon, and better ones follow.
    pub fn new(budget: f64) -> Ladder {
        Ladder {
            budget,
            level: START,
            full: RecentCosts::default(),
            made: RecentCosts::default(),
            roomy: 0,
            roomy_photons: 0,
            slow: 0,
            fewer_from: None,
            photons_fixed: false,
        }
    }

    /// How long a frame may take.
    pub fn time(&self) -> Duration {
        Duration::from_secs_f64(self.budget / 1e3)
    }

    /// Of the next frame while things move.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Learns what a frame at the current level took.
    pub fn measured(&mut self, cost: Cost) {
        let (pixels, all) = (self.level.pixels(), f64::from(FEWER[self.level.fewer]));
        let anew = cost.photons > 0.0;
        if anew {
            self.made.add(cost.photons * all, FAR * self.budget * PHOTON_SHARE * all);
        }
        let made = self.made.get().map_or(0.0, |made| made / all);
        let left = self.budget - if anew { made.min(self.budget * PHOTON_SHARE) } else { 0.0 };
        self.full.add(cost.pixels / pixels, FAR * left / pixels);
        if anew && !self.level.no_gathering && self.photons(made) {
            return;
        }
        let Some(full) = self.full.get() else { return };
        if full * pixels > left * SNUG {
            return self.down(full, left * SNUG);
        }
        self.slow = 0;
        if !self.up(full, left * ROOM, anew) {
            self.roomy = 0;
        }
    }

    /// Another number of photons, which are gathered otherwise.
    fn set_fewer(&mut self, fewer: usize) {
        self.level.fewer = fewer;
        self.full = RecentCosts::default();
        (self.roomy, self.roomy_photons) = (0, 0);
    }

    fn down(&mut self, full: f64, left: f64) {
        self.roomy = 0;
        let fits = finest(full, left);
        let at_last = self.level.coarse == LAST;
        match fits {
            // Gathering is what costs, and fewer photons are gathered sooner.
            _ if fits.is_none_or(|coarse| coarse > WORTH[1]) && self.level.fewer < START.fewer => {
                self.level.coarse = self.level.coarse.max(WORTH[1]);
                self.set_fewer(self.level.fewer + 1);
            }
            Some(coarse) => self.level.coarse = coarse,
            None if at_last && self.level.fewer < FEWER.len() - 1 => self.set_fewer(self.level.fewer + 1),
            // Without gathering the lowest resolution is not needed. A single slow frame is no reason yet.
            None if at_last => {
                self.slow += 1;
                if self.slow >= PATIENCE {
                    (self.level.no_gathering, self.slow) = (true, 0);
                    self.level.coarse = START.coarse;
                    self.full = RecentCosts::default();
                }
            }
            None => self.level.coarse = LAST,
        }
    }

    /// Takes what is better after a while, where `left` ms have room for it; whether they have.
    fn up(&mut self, full: f64, left: f64, anew: bool) -> bool {
        // Photons that are made anew for every frame have a share of their own, see `photons`. Those that are kept while
        // only the camera moves cost once, and then by being gathered. Whether gathering is affordable again cannot be
        // told from frames without it: it comes back when things rest.
        if !anew && !self.level.no_gathering && self.level.fewer > 0 {
            let (now, more) = (f64::from(FEWER[self.level.fewer]), self.level.fewer - 1);
            let made = self.made.get().map_or(0.0, |made| made / f64::from(FEWER[more]));
            let gathered = full * now / f64::from(FEWER[more]);
            if made <= self.budget * PHOTON_SHARE && finest(gathered, left).is_some_and(|coarse| coarse <= WORTH[0]) {
                self.roomy += 1;
                if self.roomy >= PATIENCE {
                    // The frame that makes them has less time for its pixels.
                    self.level.coarse = finest(gathered, left - made).unwrap_or(LAST);
                    self.set_fewer(more);
                }
                return true;
            }
        }
        let most = full * self.level.pixels() * GROWTH;
        let Some(finer) = finest(full, left.min(most)).filter(|finer| *finer < self.level.coarse) else {
            return false;
        };
        self.roomy += 1;
        if self.roomy >= PATIENCE {
            (self.level.coarse, self.roomy) = (finer, 0);
        }
        true
    }

    /// Settles how many photons are made for every frame, which take `took` ms; whether that is another number now.
    fn photons(&mut self, took: f64) -> bool {
        let share = self.budget * PHOTON_SHARE;
        if let Some((from, before)) = self.fewer_from
            && self.made.count() == JUDGED
        {
            self.fewer_from = None;
            if took > before * FIXED {
                self.photons_fixed = true;
                self.made = RecentCosts::default();
                self.set_fewer(from);
                return true;
            }
        }
        let now = f64::from(FEWER[self.level.fewer]);
        if took > share && !self.photons_fixed && self.level.fewer < FEWER.len() - 1 {
            self.fewer_from = Some((self.level.fewer, took));
            let fits = |fewer: &usize| took * now / f64::from(FEWER[*fewer]) <= share;
            let fewer = (self.level.fewer + 1..FEWER.len()).find(fits).unwrap_or(FEWER.len() - 1);
            self.made = RecentCosts::default();
            self.set_fewer(fewer);
            return true;
        }
        let (Some(full), true) = (self.full.get(), self.level.fewer > 0) else { return false };
        let next = self.level.fewer - 1;
        let more = now / f64::from(FEWER[next]);
        // They cost by being gathered, too.
        let fits = finest(full * more, (self.budget - took * more) * ROOM).filter(|coarse| *coarse <= WORTH[0]);
        let Some(coarse) = fits.filter(|_| took * more <= share * ROOM) else {
            self.roomy_photons = 0;
            return false;
        };
        self.roomy_photons += 1;
        if self.roomy_photons < PATIENCE {
            return false;
        }
        self.level.coarse = coarse;
        self.set_fewer(next);
        true
    }

    /// Things rest: gathering may be tried again when they move next.
    pub fn rested(&mut self) {
        if std::mem::take(&mut self.level.no_gathering) {
            self.full = RecentCosts::default();
        }
        self.photons_fixed = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs frames whose cost at full quality is given, and tells the levels.
    fn run(ladder: &mut Ladder, full: Cost, frames: usize) -> Vec<Level> {
        let mut levels = Vec::new();
        for _ in 0..frames {
            let level = ladder.level();
            levels.push(level);
            let gathering = if level.no_gathering { 0.1 } else { 1.0 };
            ladder.measured(Cost {
                photons: full.photons / f64::from(FEWER[level.fewer]),
                pixels: full.pixels * level.pixels() * gathering,
            });
        }
        levels
    }

    #[test]
    fn a_fast_machine_climbs_to_full_quality_and_stays() {
        let mut ladder = Ladder::new(33.0);
        let levels = run(&mut ladder, Cost { photons: 2.0, pixels: 5.0 }, 80);
        assert!(levels[0] != Level::FULL);
        assert!(levels[60..].iter().all(|level| *level == Level::FULL), "{levels:?}");
    }

    #[test]
    fn a_slow_machine_settles_within_the_budget_without_swinging() {
        for pixels in [90.0, 150.0, 400.0, 1000.0, 3000.0] {
            for photons in [0.0, 30.0, 300.0] {
                let mut ladder = Ladder::new(100.0);
                let levels = run(&mut ladder, Cost { photons, pixels }, 120);
                let settled = levels[100];
                assert!(levels[100..].iter().all(|level| *level == settled), "{pixels} {photons}: {levels:?}");
                let cost = pixels * settled.pixels() + photons / f64::from(FEWER[settled.fewer]);
                assert!(cost <= 100.0, "{pixels} {photons} settles at {settled:?}: {cost}");
                // And no lower than it must: the next rung up would not fit comfortably.
                if settled.coarse > 0 {
                    let finer = Level { coarse: settled.coarse - 1, ..settled };
                    assert!(pixels * finer.pixels() > 100.0 * ROOM * PHOTON_SHARE, "{pixels} {photons}: {settled:?}");
                }
            }
        }
    }

    #[test]
    fn it_steps_down_at_once_and_up_with_patience() {
        let mut ladder = Ladder::new(100.0);
        run(&mut ladder, Cost { photons: 0.0, pixels: 50.0 }, 60);
        assert_eq!(ladder.level().coarse, 0);
        ladder.measured(Cost { photons: 0.0, pixels: 350.0 });
        assert_eq!(
            COARSE[ladder.level().coarse],
            2.0,
            "one far too slow frame is enough, and one step goes all the way"
        );
        for _ in 0..PATIENCE - 1 {
            ladder.measured(Cost { photons: 0.0, pixels: 10.0 });
            assert_eq!(COARSE[ladder.level().coarse], 2.0);
        }
        ladder.measured(Cost { photons: 0.0, pixels: 10.0 });
        assert_eq!(COARSE[ladder.level().coarse], 1.0);
    }

    #[test]
    fn a_frame_that_stands_out_is_no_reason() {
        let mut ladder = Ladder::new(100.0);
        run(&mut ladder, Cost { photons: 0.0, pixels: 300.0 }, 60);
        let settled = ladder.level();
        for _ in 0..5 {
            // A stall of the machine, and frames as before.
            ladder.measured(Cost { photons: 0.0, pixels: 150.0 });
            assert_eq!(ladder.level(), settled);
            for _ in 0..3 {
                ladder.measured(Cost { photons: 0.0, pixels: 300.0 * settled.pixels() });
                assert_eq!(ladder.level(), settled);
            }
        }
        // Twice in a row is one.
        ladder.measured(Cost { photons: 0.0, pixels: 150.0 });
        ladder.measured(Cost { photons: 0.0, pixels: 150.0 });
        assert!(ladder.level().coarse > settled.coarse);
    }

    #[test]
    fn what_is_affordable_is_used() {
        for pixels in [300.0, 1000.0, 2500.0] {
            let mut ladder = Ladder::new(100.0);
            let levels = run(&mut ladder, Cost { photons: 0.0, pixels }, 120);
            let cost = pixels * levels[119].pixels();
            assert!((60.0..=100.0).contains(&cost), "{pixels} settles at {cost} ms");
        }
    }

    #[test]
    fn one_slow_frame_does_not_end_gathering_and_photons_go_before_it() {
        let mut ladder = Ladder::new(100.0);
        let slow = Cost { photons: 0.0, pixels: 5000.0 };
        // It starts a rung above the lowest of both.
        for _ in 0..2 + PATIENCE / 2 {
            ladder.measured(slow);
        }
        assert_eq!((ladder.level().fewer, ladder.level().no_gathering), (FEWER.len() - 1, false));
        ladder.measured(Cost { photons: 0.0, pixels: 50.0 });
        ladder.measured(slow);
        assert!(!ladder.level().no_gathering);
    }

    #[test]
    fn photons_that_are_kept_become_more_where_there_is_room() {
        let mut ladder = Ladder::new(33.0);
        // Gathering grows with the photons; they are made anew only where their number changes.
        let mut last = ladder.level().fewer;
        for _ in 0..100 {
            let fewer = ladder.level().fewer;
            let photons = if fewer == last { 0.0 } else { 20.0 / f64::from(FEWER[fewer]) };
            last = fewer;
            let pixels = (2.0 + 18.0 / f64::from(FEWER[fewer])) * ladder.level().pixels();
            ladder.measured(Cost { photons, pixels });
        }
        assert_eq!(ladder.level(), Level { fewer: 1, ..Level::FULL }, "half of them: 11 ms; all of them would not fit");
    }

    #[test]
    fn photons_stay_where_fewer_would_take_as_long() {
        let mut ladder = Ladder::new(33.0);
        let first = ladder.level().fewer;
        for _ in 0..20 {
            ladder.measured(Cost { photons: 30.0, pixels: 1.0 });
        }
        assert_eq!(ladder.level().fewer, first);
    }

    #[test]
    fn gathering_goes_last_and_comes_back_at_rest() {
        let mut ladder = Ladder::new(33.0);
        run(&mut ladder, Cost { photons: 0.0, pixels: 20_000.0 }, 20);
        assert!(ladder.level().no_gathering);
        ladder.rested();
        assert!(!ladder.level().no_gathering);
    }
}
