//! What frames typically take.

/// Frames by which one is judged. The middle of three: one that stands out is the machine's own doing.
pub const JUDGED: usize = 3;

/// What is typical of the last costs of a kind, ms.
#[derive(Clone, Debug, Default)]
pub struct RecentCosts {
    last: Vec<f64>,
    /// The first of them is beyond doubt.
    is_far: bool,
}

impl RecentCosts {
    /// Adds the cost of a frame; one beyond `far` counts alone.
    pub fn add(&mut self, cost: f64, far: f64) {
        if cost > far {
            *self = RecentCosts { last: Vec::new(), is_far: true };
        } else if self.last.len() == JUDGED {
            self.last.remove(0);
            self.is_far = false;
        }
        self.last.push(cost);
    }

    /// How many of the last costs count.
    pub fn count(&self) -> usize {
        self.last.len()
    }

    /// The middle one, or the lower one of two. One alone tells nothing yet, unless it is far off.
    pub fn get(&self) -> Option<f64> {
        let mut sorted = self.last.clone();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.len().saturating_sub(1) / 2;
        sorted.get(middle).copied().filter(|_| sorted.len() > 1 || self.is_far)
    }
}
