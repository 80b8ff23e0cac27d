//! What stages take.

use std::time::Instant;

/// Milliseconds by stage; 0 for what was not run.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Times {
    /// Building programs.
    pub compile: f64,
    /// Emission of photons.
    pub emit: f64,
    /// Photons into cells.
    pub grid: f64,
    /// Photons into screen-space tiles.
    pub tiles: f64,
    /// Scene records, and the photon map, to where they are read.
    pub upload: f64,
    /// Rays, shading, gathering.
    pub trace: f64,
    /// Film to the host.
    pub readback: f64,
    /// All of it.
    pub total: f64,
}

impl Times {
    /// Adds another picture's times.
    pub fn add(&mut self, other: &Times) {
        self.compile += other.compile;
        self.emit += other.emit;
        self.grid += other.grid;
        self.tiles += other.tiles;
        self.upload += other.upload;
        self.trace += other.trace;
        self.readback += other.readback;
        self.total += other.total;
    }
}

/// Tells the time since it was asked last.
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// From now on.
    pub fn start() -> Stopwatch {
        Stopwatch(Instant::now())
    }

    /// Milliseconds since the last call, or since the start.
    pub fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let elapsed = now - std::mem::replace(&mut self.0, now);
        elapsed.as_secs_f64() * 1e3
    }
}
