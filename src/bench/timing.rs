//! Times that mean something on a machine that others use too: medians of runs taken in turn.

use crate::error::Result;

/// The middle value; the mean of the two middle ones of an even number; NaN of none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match (sorted.len(), sorted.len() / 2) {
        (0, _) => f64::NAN,
        (odd, middle) if odd % 2 == 1 => sorted[middle],
        (_, middle) => (sorted[middle - 1] + sorted[middle]) / 2.0,
    }
}

/// Times of one thing, milliseconds, by round.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// In the order in which they were taken.
    pub ms: Vec<f64>,
}

impl Samples {
    /// The middle one of the times, ms: see [`median`].
    pub fn median(&self) -> f64 {
        median(&self.ms)
    }

    /// The least: what a quiet machine would show.
    pub fn least(&self) -> f64 {
        self.ms.iter().copied().fold(f64::NAN, f64::min)
    }

    /// How many times longer than `base` this takes: the median of the rounds' own quotients. Both of a round were
    /// taken within moments of each other, so what slowed one slowed the other.
    pub fn ratio_to(&self, base: &Samples) -> f64 {
        let quotients: Vec<f64> = self.ms.iter().zip(&base.ms).map(|(own, base)| own / base).collect();
        median(&quotients)
    }
}

/// Runs that take longer than this while warming up, milliseconds, make [`FEW`] rounds only.
const LONG: f64 = 300.0;

/// Enough for a median that one disturbed run cannot move.
const FEW: u32 = 3;

/// Times each of `subjects` over `rounds` rounds, one run of each in turn, after one of each that does not count:
/// it compiles, allocates and fills caches. `run` gives the milliseconds of one run; round 0 is the one to warm up.
///
/// # Errors
/// The first that `run` gives.
pub fn in_turn<T>(
    subjects: &mut [T],
    rounds: u32,
    mut run: impl FnMut(&mut T, u32) -> Result<f64>,
) -> Result<Vec<Samples>> {
    let mut samples = vec![Samples::default(); subjects.len()];
    let mut wanted = Vec::new();
    for subject in subjects.iter_mut() {
        let long = run(subject, 0)? > LONG;
        wanted.push(if long { rounds.min(FEW) } else { rounds });
    }
    for round in 1..=rounds {
        for ((subject, samples), _) in subjects.iter_mut().zip(&mut samples).zip(&wanted).filter(|(_, w)| round <= **w)
        {
            samples.ms.push(run(subject, round)?);
        }
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_even_and_none() {
        assert_eq!(median(&[5.0, 1.0, 3.0]), 3.0);
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn ratios_hold_though_the_machine_slows_down() {
        let base = Samples { ms: vec![10.0, 40.0, 10.0, 80.0] };
        let twice = Samples { ms: base.ms.iter().map(|ms| 2.0 * ms).chain([5.0]).collect() };
        assert_eq!(twice.ratio_to(&base), 2.0);
        // Taken apart, the medians would tell otherwise.
        assert_ne!(twice.median() / base.median(), 2.0);
        assert_eq!(base.least(), 10.0);
    }

    #[test]
    fn runs_are_taken_in_turn_and_long_ones_less_often() {
        let mut order = Vec::new();
        let mut subjects = [("quick", 1.0), ("long", 2000.0)];
        let samples = in_turn(&mut subjects, 5, |(name, ms), round| {
            order.push((*name, round));
            Ok(*ms + f64::from(round))
        });
        let samples = samples.unwrap();
        assert_eq!(order[..4], [("quick", 0), ("long", 0), ("quick", 1), ("long", 1)]);
        assert_eq!(samples[0].ms, [2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(samples[1].ms.len(), 3);
    }
}
