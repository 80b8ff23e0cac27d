//! The frame budget: which quality a frame may have so that it is done in time. No clock in here, only milliseconds.

/// Pixels are this many times as wide and high as the window's, rung by rung.
pub const COARSE: [f64; 9] = [1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0];
/// Paths of a pass are divided by this, rung by rung.
pub const FEWER: [u32; 5] = [1, 2, 4, 10, 25];
/// A step up must leave this much of the budget free: what is just affordable would fall back at once.
const ROOM: f64 = 0.8;
/// A step up is taken after so many frames that had room.
const PATIENCE: u32 = 4;
/// Photons may take this share of the budget, where they are made anew for every frame.
const PHOTON_SHARE: f64 = 0.5;
/// Where fewer photons take more than this share of what more of them took, they are not what it costs.
const FIXED: f64 = 0.8;

/// Quality of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Level {
    /// Index into [`COARSE`].
    pub coarse: usize,
    /// Index into [`FEWER`].
    pub fewer: usize,
    /// Direct light only: the last resort.
    pub no_gathering: bool,
}

impl Level {
    /// As good as asked for.
    pub const FULL: Level = Level { coarse: 0, fewer: 0, no_gathering: false };

    /// A picture's side at this level, pixels.
    pub fn side(self, full: u32) -> u32 {
        ((f64::from(full) / COARSE[self.coarse]).round() as u32).clamp(1, full.max(1))
    }

    /// Paths at this level.
    pub fn paths(self, full: u32) -> u32 {
        (full / FEWER[self.fewer]).max(1)
    }

    /// Pixels, relative to a full picture's.
    fn pixels(self) -> f64 {
        COARSE[self.coarse].powi(-2)
    }

    /// As the title and the panel say it.
    pub fn describe(self) -> String {
        let mut parts = Vec::new();
        if self.coarse > 0 {
            parts.push(format!("1/{} resolution", COARSE[self.coarse]));
        }
        if self.fewer > 0 && !self.no_gathering {
            parts.push(format!("1/{} photons", FEWER[self.fewer]));
        }
        if self.no_gathering {
            parts.push("direct light only".into());
        }
        if parts.is_empty() { "full".into() } else { parts.join(", ") }
    }
}

/// What a frame took, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Making, sorting and moving photons; 0 where the last frame's were kept.
    pub photons: f64,
    /// Tracing and gathering, and all else that grows with pixels.
    pub pixels: f64,
}

/// Steps down at once and up with patience.
#[derive(Clone, Debug)]
pub struct Ladder {
    /// Milliseconds that a frame may take.
    pub budget: f64,
    level: Level,
    roomy: u32,
    roomy_photons: u32,
    /// Frames that took too long though nothing but gathering is left to drop.
    slow: u32,
    /// What all photons would take, ms, by the last ones that were made.
    all_photons: Option<f64>,
    /// The last step down in photons: from where, and what they took there.
    fewer_from: Option<(usize, f64)>,
    /// Fewer photons take no less: what they take are the driver's own costs.
    photons_fixed: bool,
}

impl Ladder {
    /// Starts low: the first frame shall be there soon, and better ones follow.
    pub fn new(budget: f64) -> Ladder {
        let level = Level { coarse: COARSE.len() - 2, fewer: FEWER.len() - 2, no_gathering: false };
        let (all_photons, fewer_from) = (None, None);
        Ladder { budget, level, roomy: 0, roomy_photons: 0, slow: 0, all_photons, fewer_from, photons_fixed: false }
    }

    /// Of the next frame while things move.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Learns what a frame at the current level took.
    pub fn measured(&mut self, cost: Cost) {
        self.photons(cost.photons);
        let left = self.budget - cost.photons.min(self.budget * PHOTON_SHARE);
        let per_full = cost.pixels / self.level.pixels();
        let fits = |coarse: usize, share: f64| per_full / COARSE[coarse].powi(2) <= left * share;
        if cost.pixels > left {
            self.roomy = 0;
            match (self.level.coarse..COARSE.len()).find(|coarse| fits(*coarse, 1.0)) {
                Some(coarse) => self.level.coarse = coarse,
                // Gathering is what costs, and fewer photons are gathered sooner.
                None if self.level.coarse == COARSE.len() - 1 && self.level.fewer < FEWER.len() - 1 => {
                    self.level.fewer += 1;
                }
                // Without gathering the lowest resolution is not needed. A single slow frame is no reason yet.
                None if self.level.coarse == COARSE.len() - 1 => {
                    self.slow += 1;
                    if self.slow >= PATIENCE {
                        (self.level.no_gathering, self.slow) = (true, 0);
                        self.level.coarse = COARSE.len() - 3;
                    }
                }
                None => self.level.coarse = COARSE.len() - 1,
            }
            return;
        }
        self.slow = 0;
        let next = self.level.coarse.saturating_sub(1);
        // Whether gathering is affordable again cannot be told from frames without it: it comes back when things rest.
        if self.level.coarse > 0 && fits(next, ROOM) {
            self.roomy += 1;
            if self.roomy >= PATIENCE {
                (self.level.coarse, self.roomy) = (next, 0);
            }
        } else if self.level.coarse == 0 && self.level.fewer > 0 && cost.photons == 0.0 {
            // Photons are kept while only the camera moves: more of them cost once, and then by being gathered.
            let more = self.level.fewer - 1;
            let gathered = f64::from(FEWER[self.level.fewer]) / f64::from(FEWER[more]);
            let made = self.all_photons.map_or(0.0, |all| all / f64::from(FEWER[more]));
            let fits = cost.pixels * gathered <= left * ROOM && made <= self.budget * PHOTON_SHARE;
            self.roomy = if fits { self.roomy + 1 } else { 0 };
            if self.roomy >= PATIENCE {
                (self.level.fewer, self.roomy) = (more, 0);
            }
        } else {
            self.roomy = 0;
        }
    }

    fn photons(&mut self, took: f64) {
        let share = self.budget * PHOTON_SHARE;
        if took == 0.0 || self.level.no_gathering {
            return; // nothing was made, nothing is learnt
        }
        if let Some((from, before)) = self.fewer_from.take()
            && took > before * FIXED
        {
            (self.level.fewer, self.photons_fixed) = (from, true);
        }
        self.all_photons = Some(took * f64::from(FEWER[self.level.fewer]));
        if took > share && !self.photons_fixed {
            self.fewer_from = Some((self.level.fewer, took));
            let per_path = took * f64::from(FEWER[self.level.fewer]);
            let fits = |fewer: &usize| per_path / f64::from(FEWER[*fewer]) <= share;
            self.level.fewer = (self.level.fewer..FEWER.len()).find(fits).unwrap_or(FEWER.len() - 1);
            self.roomy_photons = 0;
            return;
        }
        let next = self.level.fewer.saturating_sub(1);
        let more = f64::from(FEWER[self.level.fewer]) / f64::from(FEWER[next]);
        self.roomy_photons = if took * more <= share * ROOM { self.roomy_photons + 1 } else { 0 };
        // At the lowest resolution photons are few because gathering them costs.
        let lowest = self.level.coarse == COARSE.len() - 1;
        if self.level.fewer > 0 && !lowest && self.roomy_photons >= PATIENCE {
            (self.level.fewer, self.roomy_photons) = (next, 0);
        }
    }

    /// Things rest: gathering may be tried again when they move next.
    pub fn rested(&mut self) {
        (self.level.no_gathering, self.photons_fixed) = (false, false);
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
        ladder.measured(Cost { photons: 0.0, pixels: 390.0 });
        assert_eq!(COARSE[ladder.level().coarse], 2.0, "one slow frame is enough, and one step goes all the way");
        for _ in 0..PATIENCE - 1 {
            ladder.measured(Cost { photons: 0.0, pixels: 10.0 });
            assert_eq!(COARSE[ladder.level().coarse], 2.0);
        }
        ladder.measured(Cost { photons: 0.0, pixels: 10.0 });
        assert_eq!(COARSE[ladder.level().coarse], 1.5);
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

    #[test]
    fn levels_scale_sides_and_paths() {
        let level = Level { coarse: 3, fewer: 2, no_gathering: false };
        assert_eq!((level.side(641), level.side(1), level.paths(200_000), level.paths(1)), (321, 1, 50_000, 1));
        assert_eq!(Level::FULL.describe(), "full");
        assert_eq!(level.describe(), "1/2 resolution, 1/4 photons");
    }
}
