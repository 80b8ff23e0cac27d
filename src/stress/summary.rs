//! Lines of the stress table.

use serde::Serialize;

use super::Suite;
use crate::bench::table::{Table, Value};
use crate::settings::Backend;

/// How a quantity is spread over many cases.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// How many cases there were.
    pub count: u64,
    /// Half of them are at most this.
    pub median: f64,
    /// 99 of 100 of them are at most this.
    pub p99: f64,
    /// All of them are at most this.
    pub worst: f64,
}

impl Spread {
    /// Of non-negative values; NaN is worse than any.
    pub fn of(values: &[f64]) -> Spread {
        let mut sorted: Vec<f64> = values.iter().map(|v| if v.is_nan() { f64::INFINITY } else { *v }).collect();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let place = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(place.saturating_sub(1)).copied().unwrap_or(f64::NAN)
        };
        Spread { count: values.len() as u64, median: at(0.5), p99: at(0.99), worst: at(1.0) }
    }

    /// A number of events among `count` cases.
    pub fn events(events: u64, count: u64) -> Spread {
        Spread { count, median: f64::NAN, p99: f64::NAN, worst: events as f64 }
    }

    /// One number alone.
    pub fn one(value: f64) -> Spread {
        Spread { count: 1, median: f64::NAN, p99: f64::NAN, worst: if value.is_nan() { f64::INFINITY } else { value } }
    }
}

/// A line: one quantity of one case on one machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The suite that measured it.
    pub suite: Suite,
    /// The case, by name.
    pub case: String,
    /// The backend that was measured.
    pub backend: Backend,
    /// Quantity and unit.
    pub measure: &'static str,
    /// How the quantity was spread over the case's samples.
    #[serde(flatten)]
    pub spread: Spread,
    /// What the worst may be.
    pub bound: f64,
    /// Whether the worst is within the bound.
    pub holds: bool,
}

impl Row {
    /// A line that holds when there are cases and the worst is within the bound.
    pub fn new(
        suite: Suite,
        case: impl Into<String>,
        backend: Backend,
        measure: &'static str,
        spread: Spread,
        bound: f64,
    ) -> Row {
        let holds = spread.count > 0 && spread.worst <= bound;
        Row { suite, case: case.into(), backend, measure, spread, bound, holds }
    }
}

/// The lines as a table.
pub fn table(rows: &[Row]) -> Table {
    let columns = ["suite", "case", "backend", "measure", "cases", "median", "p99", "worst", "bound", "verdict"];
    let mut table = Table::new(columns);
    for row in rows {
        let shown = |value: f64| if value.is_nan() { Value::Missing } else { Value::Real(value) };
        let Spread { count, median, p99, worst } = row.spread;
        table.push([
            row.suite.name().into(),
            row.case.as_str().into(),
            row.backend.name().into(),
            row.measure.into(),
            count.into(),
            shown(median),
            shown(p99),
            if worst.is_infinite() { "infinite".into() } else { shown(worst) },
            row.bound.into(),
            if row.holds { "holds" } else { "FAILS" }.into(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_and_the_worst() {
        let values: Vec<f64> = (1..=1000).map(f64::from).rev().collect();
        assert_eq!(Spread::of(&values), Spread { count: 1000, median: 500.0, p99: 990.0, worst: 1000.0 });
        assert_eq!(Spread::of(&[1.0, f64::NAN]).worst, f64::INFINITY);
    }

    #[test]
    fn nothing_tested_and_numbers_that_are_none_fail() {
        let row = |spread, bound| Row::new(Suite::Leaks, "x", Backend::Cpu, "m", spread, bound).holds;
        assert!(row(Spread::of(&[1.0, 2.0]), 2.0) && !row(Spread::of(&[1.0, 2.0]), 1.9));
        assert!(!row(Spread::of(&[]), 1.0) && !row(Spread::one(f64::NAN), f64::MAX));
        assert!(row(Spread::events(0, 5), 0.0) && !row(Spread::events(1, 5), 0.0) && !row(Spread::events(0, 0), 0.0));
    }
}
