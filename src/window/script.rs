//! Recorded camera paths: key frames in a TOML file, replayed with a fixed time step.
//!
//! ```toml
//! step = 0.05          # seconds from picture to picture
//! repeat = 1           # how often the path is gone through
//!
//! [[keys]]
//! time = 0.0           # seconds, rising
//! position = [0, 0, 1]
//! look_at = [0, 0, 0]
//! light = [0, 2.7, -7] # optional: where the first light is, so that photons are made anew
//! ```
//!
//! Between keys all go along a Catmull-Rom spline; times and places are the same in every replay, whatever the machine.

use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::scene::Scene;

/// A camera path as its file has it.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// Seconds from picture to picture.
    pub step: f64,
    /// How often the path is gone through.
    #[serde(default = "once")]
    pub repeat: u32,
    /// Moments that the camera passes, at least two, by rising time.
    pub keys: Vec<KeyFrame>,
}

fn once() -> u32 {
    1
}

/// A moment of the path.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KeyFrame {
    /// Seconds from the beginning.
    pub time: f64,
    /// Camera, world space, metres.
    pub position: [f64; 3],
    /// What it looks at.
    pub look_at: [f64; 3],
    /// The first light, where it moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<[f64; 3]>,
}

/// Most pictures of a script: a day at 100 a second.
const MOST_FRAMES: f64 = 8.64e6;

impl Script {
    /// Reads and checks a script file.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the file, what was found and what was expected.
    pub fn load(path: &Path) -> Result<Script> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| Error::Usage(format!("script {}: {error}", path.display())))?;
        Script::parse(&text).map_err(|what| Error::Usage(format!("script {}: {what}", path.display())))
    }

    /// Reads and checks the text of a script.
    ///
    /// # Errors
    /// With what was found and what was expected.
    pub fn parse(text: &str) -> std::result::Result<Script, String> {
        let script: Script = toml_edit::de::from_str(text).map_err(|error| error.to_string())?;
        if !(script.step > 0.0 && script.step.is_finite()) {
            return Err(format!("found step = {}, expected seconds > 0", script.step));
        }
        if script.keys.len() < 2 {
            return Err(format!("found {} [[keys]], expected two or more", script.keys.len()));
        }
        for (number, key) in script.keys.iter().enumerate() {
            let numbers = key.position.iter().chain(&key.look_at).chain(key.light.iter().flatten());
            if !key.time.is_finite() || numbers.clone().any(|x| !x.is_finite() || x.abs() > 1e15) {
                return Err(format!("found key {} with a number out of range, expected up to 1e15", number + 1));
            }
            if key.position == key.look_at {
                return Err(format!("found key {} that looks at its own position", number + 1));
            }
        }
        if let Some(at) = script.keys.windows(2).position(|pair| pair[1].time <= pair[0].time) {
            return Err(format!(
                "found key {} at the time of the one before or earlier, expected rising times",
                at + 2
            ));
        }
        if script.duration() / script.step * f64::from(script.repeat) > MOST_FRAMES || script.repeat == 0 {
            return Err(format!("found more than {MOST_FRAMES} pictures or none, expected a longer step"));
        }
        Ok(script)
    }

    fn duration(&self) -> f64 {
        self.keys[self.keys.len() - 1].time - self.keys[0].time
    }

    /// Pictures in all.
    pub fn frames(&self) -> usize {
        self.frames_once() * self.repeat as usize
    }

    fn frames_once(&self) -> usize {
        // 1e-9: a duration of whole steps must not lose its last picture to rounding.
        (self.duration() / self.step + 1e-9) as usize + 1
    }

    /// A picture's scene.
    pub fn apply(&self, frame: usize, scene: &mut Scene) {
        let key = self.at((frame % self.frames_once()) as f64 * self.step);
        scene.camera.position = key.position.into();
        scene.camera.look_at = key.look_at.into();
        if let (Some(light), Some(first)) = (key.light, scene.lights.points.first_mut()) {
            first.position = light.into();
        }
    }

    /// The path `seconds` after its beginning.
    pub fn at(&self, seconds: f64) -> KeyFrame {
        let time = self.keys[0].time + seconds.clamp(0.0, self.duration());
        let next = self.keys.partition_point(|key| key.time <= time).clamp(1, self.keys.len() - 1);
        let key = |i: isize| &self.keys[i.clamp(0, self.keys.len() as isize - 1) as usize];
        let i = next as isize;
        let around = [key(i - 2), key(i - 1), key(i), key(i + 1)];
        let t = (time - around[1].time) / (around[2].time - around[1].time);
        let along = |of: fn(&KeyFrame) -> [f64; 3]| spline(around.map(|key| DVec3::from(of(key))), t).to_array();
        let light = match around.map(|key| key.light) {
            [a, Some(b), Some(c), d] => {
                let points = [a.unwrap_or(b), b, c, d.unwrap_or(c)].map(DVec3::from);
                Some(spline(points, t).to_array())
            }
            [_, b, _, _] => b,
        };
        KeyFrame { time, position: along(|key| key.position), look_at: along(|key| key.look_at), light }
    }
}

/// Uniform Catmull-Rom, from the second to the third point.
fn spline([a, b, c, d]: [DVec3; 4], t: f64) -> DVec3 {
    let (t2, t3) = (t * t, t * t * t);
    0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t2 + (3.0 * b - a - 3.0 * c + d) * t3)
}

/// Takes key frames from a camera in use.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    keys: Vec<KeyFrame>,
}

impl Recorder {
    /// Seconds between keys.
    const EVERY: f64 = 0.1;

    /// What is seen `time` seconds after the recording began.
    pub fn see(&mut self, time: f64, scene: &Scene) {
        // 1e-9: a key that is due must not wait for the next picture because of rounding.
        if self.keys.last().is_some_and(|last| time - last.time < Self::EVERY - 1e-9) {
            return;
        }
        let camera = &scene.camera;
        let light = scene.lights.points.first().map(|light| light.position.to_array());
        let (position, look_at) = (camera.position.to_array(), camera.look_at.to_array());
        self.keys.push(KeyFrame { time, position, look_at, light });
    }

    /// The file's text; nothing before there are two keys.
    pub fn finish(self, scene: &Scene) -> Option<String> {
        if self.keys.len() < 2 {
            return None;
        }
        let mut script = Script { step: 0.05, repeat: 1, keys: self.keys };
        // A light that stayed where the scene has it needs no mention.
        let home = scene.lights.points.first().map(|light| light.position.to_array());
        if script.keys.iter().all(|key| key.light == home) {
            script.keys.iter_mut().for_each(|key| key.light = None);
        }
        toml_edit::ser::to_string_pretty(&script).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "step = 0.1\n[[keys]]\ntime = 0\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n\
        [[keys]]\ntime = 1\nposition = [1, 0, 1]\nlook_at = [0, 0, 0]\nlight = [0, 1, 0]\n\
        [[keys]]\ntime = 2\nposition = [1, 1, 1]\nlook_at = [0, 0, 0]\nlight = [0, 3, 0]\n";

    #[test]
    fn paths_go_through_their_keys_in_whole_steps() {
        let script = Script::parse(TEXT).unwrap();
        assert_eq!(script.frames(), 21);
        for (seconds, position) in [(0.0, [0.0, 0.0, 1.0]), (1.0, [1.0, 0.0, 1.0]), (2.0, [1.0; 3]), (9.0, [1.0; 3])] {
            assert_eq!(script.at(seconds).position, position);
        }
        assert_eq!((script.at(0.5).light, script.at(1.5).light), (None, Some([0.0, 2.0, 0.0])));
        // Between keys: near the straight line, and without a jump.
        let [x, y, _] = script.at(0.5).position;
        assert!((0.4..0.7).contains(&x) && y.abs() < 0.2, "{x} {y}");
        assert_eq!(Script::parse(&TEXT.replace("step = 0.1", "step = 0.1\nrepeat = 3")).unwrap().frames(), 63);
    }

    #[test]
    fn bad_scripts_say_what_is_wrong() {
        for (from, to, expected) in [
            ("step = 0.1", "step = 0", "found step = 0"),
            ("step = 0.1", "step = 1e-9", "longer step"),
            ("time = 1", "time = 0", "key 2"),
            ("position = [0, 0, 1]", "position = [0, 0, 0]", "key 1 that looks at its own position"),
            ("look_at", "lookat", "unknown field"),
            ("time = 2", "time = nan", "key 3"),
        ] {
            let error = Script::parse(&TEXT.replacen(from, to, 1)).unwrap_err();
            assert!(error.contains(expected), "{to}: {error}");
        }
        assert!(Script::parse("step = 1\nkeys = []").unwrap_err().contains("two or more"));
    }

    #[test]
    fn what_is_recorded_is_replayed() {
        let text = "[camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n";
        let mut scene = crate::scene::parse(text, "x.toml").unwrap();
        let home = scene.clone();
        let mut recorder = Recorder::default();
        for i in 0..30 {
            scene.camera.position.x = f64::from(i) * 0.05;
            recorder.see(f64::from(i) * 0.05, &scene);
        }
        let script = Script::parse(&recorder.finish(&home).unwrap()).unwrap();
        assert_eq!(script.keys.len(), 15, "every other one");
        assert!(script.keys.iter().all(|key| key.light.is_none()));
        let mut replayed = home.clone();
        script.apply(10, &mut replayed); // 0.5 s
        assert!((replayed.camera.position.x - 0.5).abs() < 1e-9);
        assert_eq!(Recorder::default().finish(&home), None);
    }
}
