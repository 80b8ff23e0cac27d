//! How long frames take: percentiles, and memory before and after.

/// Times of many frames, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Percentiles {
    /// How many frames were timed.
    pub frames: usize,
    /// Half of them take no longer, ms.
    pub p50: f64,
    /// Nine of ten take no longer, ms.
    pub p90: f64,
    /// 99 of 100 take no longer, ms.
    pub p99: f64,
    /// The longest takes this, ms.
    pub max: f64,
}

impl Percentiles {
    /// Of a list in any order; by nearest rank.
    pub fn of(times: &[f64]) -> Percentiles {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        let rank = |share: f64| {
            let at = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(at.max(1) - 1).copied().unwrap_or(0.0)
        };
        Percentiles { frames: sorted.len(), p50: rank(0.5), p90: rank(0.9), p99: rank(0.99), max: rank(1.0) }
    }
}

/// Memory of this process in RAM, bytes; 0 where the system does not tell.
pub fn resident_bytes() -> u64 {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages: u64 = statm.split_whitespace().nth(1).and_then(|pages| pages.parse().ok()).unwrap_or(0);
    pages * 4096 // Linux on every machine that GPUs of today come with
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_exact() {
        let times: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let found = Percentiles::of(&times);
        assert_eq!(found, Percentiles { frames: 200, p50: 100.0, p90: 180.0, p99: 198.0, max: 200.0 });
        assert_eq!(Percentiles::of(&[7.0]).p99, 7.0);
        assert_eq!(Percentiles::of(&[]), Percentiles::default());
    }

    #[test]
    fn this_process_takes_memory() {
        if cfg!(target_os = "linux") {
            assert!(resident_bytes() > 1 << 20);
        }
    }
}
