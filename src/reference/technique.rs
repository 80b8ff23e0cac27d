//! Which estimator: what the tests vary, and what did best.

/// How the strategies that can make the same path share it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Heuristic {
    /// Each in proportion to its density (Veach §9.2.2): as good as the power heuristic here.
    #[cfg(test)]
    Balance,
    /// In proportion to the density squared (Veach §9.2.3).
    Power,
    /// Light paths alone wherever they can do it: unbiased, noisier.
    #[cfg(test)]
    LightPathsOnly,
    /// Deliberately wrong: every strategy counts in full. What the tests must notice.
    #[cfg(test)]
    Unweighted,
}

/// Which estimator; every choice converges to the same image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Technique {
    /// S: most vertices on the light's side, the light included; 1 is path tracing with next-event estimation.
    pub light_vertices: usize,
    /// Paths from the light to each path from the camera; all are connected to it.
    pub light_paths: usize,
    /// How strategies share a path.
    pub heuristic: Heuristic,
    /// Index of the first camera-side vertex at which Russian roulette may end the path, ≥ 1.
    pub roulette_from: usize,
    /// Only light → surface → camera.
    pub direct_only: bool,
    /// Most anchors; 0 walks every path to its end. Where there are any, `light_vertices` is at most 2: the strategies
    /// of a path split at its second vertex must not reach across it.
    pub anchors: usize,
    /// Chance of estimating the difference to the anchor.
    pub difference_rate: f64,
}

/// The estimator that did best in equal time on the report's scenes.
///
/// On `gi_ref` at 320×240, 512 samples a pixel take 119 s of processor time, hence about a minute on two
/// cores, to a mean relative noise of 0.77%; 118 samples, in 27 s, leave 2.1%.
pub(super) const TECHNIQUE: Technique = Technique {
    light_vertices: 2,
    light_paths: 2,
    heuristic: Heuristic::Power,
    roulette_from: 3,
    direct_only: false,
    anchors: 8192,
    difference_rate: 1.0,
};
