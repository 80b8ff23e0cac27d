//! Costs of the model's terms, from what methods were measured to take.

use super::{Counts, TERMS, cost};

/// What a method took.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    /// How much of each of [`TERMS`] there was to do.
    pub counts: Counts,
    /// What it took: building and gathering, milliseconds.
    pub ms: f64,
    /// How many times longer than the best method of the same setting.
    pub over_best: f64,
}

/// Costs of one of each term, nanoseconds, that fit measured milliseconds and none of them below 0: least squares by
/// coordinate descent (Franc, Hlaváč & Navara, "Sequential Coordinate-Wise Algorithm for the Non-negative Least Squares
/// Problem", 2005). Twice as much and half as much count alike: (predicted − measured) / √(predicted · measured). What
/// is far from the best of its setting need not be known as well: it counts less by that factor to the power `shun`.
pub fn fit(measured: &[Taken], shun: i32) -> Counts {
    let mut costs = [0.0; TERMS.len()];
    let mut predicted: Vec<f64> = measured.iter().map(|taken| taken.ms).collect();
    for _ in 0..20 {
        let weight = |(taken, p): (&Taken, &f64)| 1.0 / (taken.over_best.powi(shun) * (taken.ms * p).sqrt());
        let weights: Vec<f64> = measured.iter().zip(&predicted).map(weight).collect();
        let scaled = |(taken, weight): (&Taken, &f64)| taken.counts.map(|count| count * 1e-6 * weight);
        let rows: Vec<Counts> = measured.iter().zip(&weights).map(scaled).collect();
        let norms: Counts = std::array::from_fn(|term| rows.iter().map(|row| row[term] * row[term]).sum());
        let sum = |row: &Counts, costs: &Counts| row.iter().zip(costs).map(|(count, cost)| count * cost).sum::<f64>();
        let aims = measured.iter().zip(&weights).map(|(taken, weight)| taken.ms * weight);
        let mut left: Vec<f64> = rows.iter().zip(aims).map(|(row, aim)| aim - sum(row, &costs)).collect();
        for _ in 0..2000 {
            for term in (0..TERMS.len()).filter(|term| norms[*term] > 0.0) {
                let slope: f64 = rows.iter().zip(&left).map(|(row, left)| row[term] * left).sum();
                let cost = (costs[term] + slope / norms[term]).max(0.0);
                let step = cost - costs[term];
                costs[term] = cost;
                left.iter_mut().zip(&rows).for_each(|(left, row)| *left -= step * row[term]);
            }
        }
        // Nothing predicts less than a thousandth: that would outweigh all else.
        predicted = measured.iter().map(|taken| (sum(&taken.counts, &costs) * 1e-6).max(1e-3 * taken.ms)).collect();
    }
    costs
}

/// How sure a difference in cost makes the choice, in [`regret`]: a method that costs 8% less is e times as likely.
const SURE: f64 = 12.0;

/// How much longer than the best ones the methods take that these costs choose, the mean over settings of the logarithm.
/// What nearly was chosen counts as well, so that it changes smoothly and close decisions weigh little.
fn regret(settings: &[Vec<Taken>], costs: &Counts) -> f64 {
    let of = |rivals: &Vec<Taken>| {
        let predicted: Vec<f64> = rivals.iter().map(|rival| cost(&rival.counts, costs).max(1e-12).ln()).collect();
        let least = predicted.iter().copied().fold(f64::INFINITY, f64::min);
        let chance = |ln: &f64| (-SURE * (ln - least)).exp();
        let all: f64 = predicted.iter().map(chance).sum();
        let lost = predicted.iter().zip(rivals).map(|(ln, rival)| chance(ln) * rival.over_best.max(1.0).ln());
        lost.sum::<f64>() / all
    };
    settings.iter().map(of).sum::<f64>() / settings.len().max(1) as f64
}

/// What leaving the costs that fit the times is worth: a regret of 0.05% for a cost that is e times another.
const LEAVING: f64 = 5e-4;

/// Costs by which the methods that take least are chosen: from those that [`fit`] the times, steps of each cost as long
/// as these lower the [`regret`] by more than they lead away; the best of several such ways. A setting is the methods that
/// were measured for it.
pub fn fit_choice(settings: &[Vec<Taken>]) -> Counts {
    let ways = [1, 2, 3].map(|shun| descend(settings, fit(&settings.concat(), shun)));
    ways.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("several ways").0
}

/// The steps of [`fit_choice`] from some costs on, and what is lost by those that they lead to.
fn descend(settings: &[Vec<Taken>], mut costs: Counts) -> (Counts, f64) {
    let typical = |term: usize, costs: &Counts| {
        // A cost of 0 cannot be stepped from: a thousandth of the longest time's share is where it begins.
        let most = settings.iter().flatten().map(|taken| taken.counts[term]).fold(0.0, f64::max);
        let longest = settings.iter().flatten().map(|taken| taken.ms).fold(0.0, f64::max);
        if costs[term] > 0.0 || most == 0.0 { costs[term] } else { 1e-3 * longest * 1e6 / most }
    };
    let begun: Counts = std::array::from_fn(|term| typical(term, &costs));
    let lost = |costs: &Counts| {
        let away = costs.iter().zip(&begun).filter(|(cost, _)| **cost > 0.0).map(|(cost, begun)| (cost / begun).ln());
        regret(settings, costs) + LEAVING * away.map(|ln| ln * ln).sum::<f64>()
    };
    let mut least = lost(&costs);
    for step in [2.0, 1.5, 1.2, 1.1, 1.05].into_iter().flat_map(|step: f64| [step; 12]) {
        for term in 0..TERMS.len() {
            for factor in [step, 1.0 / step] {
                let mut other = costs;
                other[term] = typical(term, &costs) * factor;
                let lost = lost(&other);
                if lost < least {
                    (costs, least) = (other, lost);
                }
            }
        }
    }
    (costs, least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_finds_the_costs_that_made_the_times() {
        let costs: Counts = std::array::from_fn(|term| if term == 4 { 0.0 } else { 1.0 + term as f64 });
        let row = |number: usize| {
            // Numbers of no pattern, some of them 0 as where a method has no such term.
            let count =
                |term: usize| ((number * 7919 + term * 104_729) % 97 * usize::from((number + term) % 3 > 0)) as f64;
            let counts: Counts = std::array::from_fn(|term| 1e4 * (1.0 + count(term)));
            let ms = counts.iter().zip(&costs).map(|(count, cost)| count * cost).sum::<f64>() * 1e-6;
            Taken { counts, ms, over_best: 1.0 }
        };
        let found = fit(&(0..60).map(row).collect::<Vec<_>>(), 1);
        for (found, cost) in found.iter().zip(costs) {
            assert!((found - cost).abs() < 0.05, "{found}, made with {cost}");
        }
    }

    #[test]
    fn a_choice_is_fitted_where_times_alone_would_choose_wrong() {
        // A's times are those of two unlike things that one term counts; only B's term can make up for it.
        let rival = |term: usize, count: f64, ms: f64, best: f64| {
            let mut counts = [0.0; TERMS.len()];
            counts[term] = count * 1e6;
            Taken { counts, ms, over_best: ms / best }
        };
        let setting = |a: f64, b: f64| vec![rival(0, 1.0, a, a.min(b)), rival(1, 1.0, b, a.min(b))];
        let settings = [setting(1.0, 4.0), setting(5.0, 4.0), setting(1.0, 4.2), setting(1.2, 4.0)];
        let costs = fit_choice(&settings);
        assert!(regret(&settings, &costs) <= regret(&settings, &fit(&settings.concat(), 1)));
        assert!(costs[0] < costs[1], "three of four are better with A: {costs:?}");
        let wrong = [vec![rival(0, 1.0, 4.0, 1.0), rival(1, 1.0, 1.0, 1.0)]];
        assert!(regret(&wrong, &costs) > 1.0, "the worse one is chosen, which takes four times as long");
    }
}
