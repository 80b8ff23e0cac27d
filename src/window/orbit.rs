//! The camera in the user's hand: orbit, pan, dolly, fly, focus, reset. No window in here, only numbers.

use glam::DVec3;

use crate::scene::Camera;

/// A step of the mouse turns by so much: the picture's height is half a turn.
const TURN_PER_HEIGHT: f64 = std::f64::consts::PI;
/// A notch of the wheel brings the camera nearer by so much of its distance.
const DOLLY: f64 = 0.9;
/// Looking straight up or down has no horizontal; the camera stops so short of it, as the cosine of the angle.
const STEEPEST: f64 = 0.9995;

/// Which keys of flight are down: +1, 0 or −1 an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flight {
    /// 1 while D is down, −1 while A is.
    pub right: f64,
    /// 1 while E is down, −1 while Q is.
    pub up: f64,
    /// 1 while W is down, −1 while S is.
    pub forward: f64,
}

impl Flight {
    /// Whether no key of flight is down, or they cancel each other.
    pub fn is_still(self) -> bool {
        self == Flight::default()
    }
}

/// Moves a camera by drags, the wheel and keys of flight.
#[derive(Clone, Debug)]
pub struct Controller {
    /// Where it is now.
    pub camera: Camera,
    home: Camera,
    /// Metres per second of flight.
    speed: f64,
}

impl Controller {
    /// Starts at a camera, to which [`Controller::reset`] returns. `size` is the scene's, metres.
    pub fn new(camera: Camera, size: f64) -> Controller {
        Controller { home: camera.clone(), camera, speed: (size / 8.0).max(1e-6) }
    }

    /// Unit vectors to the picture's right, top, and into it.
    pub fn axes(&self) -> [DVec3; 3] {
        axes(&self.camera)
    }

    /// Distance of what the camera looks at, metres.
    pub fn distance(&self) -> f64 {
        (self.camera.look_at - self.camera.position).length()
    }

    /// Turns around what the camera looks at; steps are in heights of the picture, right and down.
    pub fn orbit(&mut self, right: f64, down: f64) {
        let offset = self.turned(self.camera.position - self.camera.look_at, -right, -down);
        self.camera.position = self.camera.look_at + offset;
    }

    /// Turns the camera itself; steps as of [`Controller::orbit`].
    pub fn look(&mut self, right: f64, down: f64) {
        let view = self.turned(self.camera.look_at - self.camera.position, -right, -down);
        self.camera.look_at = self.camera.position + view;
    }

    /// A vector turned around the up direction, then around the picture's horizontal, and not beyond the poles.
    fn turned(&self, v: DVec3, around_up: f64, around_right: f64) -> DVec3 {
        let up = self.camera.up.normalize();
        let [right, ..] = self.axes();
        let tilted = rotated(v, right, around_right * TURN_PER_HEIGHT);
        let steep = tilted.normalize().dot(up).abs() > STEEPEST;
        let upside_down = tilted.reject_from(up).dot(v.reject_from(up)) <= 0.0;
        let v = if steep || upside_down { v } else { tilted };
        rotated(v, up, around_up * TURN_PER_HEIGHT)
    }

    /// Moves camera and target across the picture, so that what is at the target's distance follows the mouse; steps
    /// are in heights of the picture.
    pub fn pan(&mut self, right: f64, down: f64) {
        let height = 2.0 * (self.camera.fov_y.to_radians() / 2.0).tan() * self.distance();
        let [x, y, _] = self.axes();
        self.shift((y * down - x * right) * height);
    }

    /// Moves nearer, or farther for negative notches; the target stays.
    pub fn dolly(&mut self, notches: f64) {
        let offset = self.camera.position - self.camera.look_at;
        self.camera.position = self.camera.look_at + offset * DOLLY.powf(notches.clamp(-20.0, 20.0));
    }

    /// Flies for `seconds`, three times as fast where `fast`.
    pub fn fly(&mut self, flight: Flight, seconds: f64, fast: bool) {
        let [x, y, z] = self.axes();
        let direction = x * flight.right + y * flight.up + z * flight.forward;
        let speed = if fast { 3.0 * self.speed } else { self.speed };
        self.shift(direction.normalize_or_zero() * speed * seconds.clamp(0.0, 0.25));
    }

    fn shift(&mut self, by: DVec3) {
        self.camera.position += by;
        self.camera.look_at += by;
    }

    /// Looks at a point and goes to where a ball of this radius around it fills half the picture.
    pub fn focus(&mut self, center: DVec3, radius: f64) {
        let [.., forward] = self.axes();
        let distance = 2.0 * radius / (self.camera.fov_y.to_radians() / 2.0).sin();
        self.camera.look_at = center;
        self.camera.position = center - forward * distance.max(1e-9);
    }

    /// Back to where it started.
    pub fn reset(&mut self) {
        self.camera = self.home.clone();
    }

    /// The file's camera has changed: it is the new start, and where the camera goes.
    pub fn rehome(&mut self, camera: Camera) {
        self.home = camera.clone();
        self.camera = camera;
    }
}

/// Unit vectors to a camera's right, top, and into its picture.
pub fn axes(camera: &Camera) -> [DVec3; 3] {
    let forward = (camera.look_at - camera.position).normalize();
    let right = forward.cross(camera.up).normalize();
    [right, right.cross(forward), forward]
}

/// `v` turned around a unit axis (Rodrigues), radians.
fn rotated(v: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    let (sin, cos) = angle.sin_cos();
    v * cos + axis.cross(v) * sin + axis * axis.dot(v) * (1.0 - cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn controller() -> Controller {
        let position = DVec3::new(1.0, 2.0, 9.0);
        Controller::new(Camera { position, look_at: DVec3::new(0.0, 0.5, 0.0), up: DVec3::Y, fov_y: 45.0 }, 10.0)
    }

    proptest! {
        #[test]
        fn orbiting_keeps_distance_and_target(steps in prop::collection::vec((-1.0..1.0, -1.0..1.0f64), 1..30)) {
            let mut held = controller();
            let (distance, target) = (held.distance(), held.camera.look_at);
            for (right, down) in steps {
                held.orbit(right, down);
                prop_assert!((held.distance() - distance).abs() < 1e-9 * distance);
                prop_assert_eq!(held.camera.look_at, target);
                // There is a horizontal, and the picture's top is up.
                let [right, up, _] = held.axes();
                prop_assert!(right.is_finite() && up.dot(DVec3::Y) > 0.0);
            }
        }

        #[test]
        fn looking_around_stays_in_place(right in -1.0..1.0f64, down in -1.0..1.0f64) {
            let mut held = controller();
            let (distance, position) = (held.distance(), held.camera.position);
            held.look(right, down);
            prop_assert!((held.distance() - distance).abs() < 1e-9 * distance);
            prop_assert_eq!(held.camera.position, position);
        }
    }

    #[test]
    fn orbiting_to_the_right_moves_the_camera_to_the_left() {
        let mut held = controller();
        let [right, ..] = held.axes();
        let before = held.camera.position;
        held.orbit(0.05, 0.0);
        assert!((held.camera.position - before).dot(right) < 0.0, "the scene follows the mouse");
        let before = held.camera.position;
        held.orbit(0.0, 0.05);
        assert!(held.camera.position.y > before.y, "pulling down shows more of the top");
    }

    #[test]
    fn panning_moves_the_target_with_the_mouse() {
        let mut held = controller();
        let target = held.camera.look_at;
        held.pan(0.25, 0.0);
        // The old target now appears a quarter of the height to the right of the middle.
        let [right, _, forward] = held.axes();
        let to_target = target - held.camera.position;
        let tangent = to_target.dot(right) / to_target.dot(forward);
        assert!((tangent / (2.0 * 22.5f64.to_radians().tan()) - 0.25).abs() < 1e-12, "{tangent}");
    }

    #[test]
    fn dolly_focus_fly_and_reset() {
        let mut held = controller();
        let (home, far) = (held.camera.clone(), held.distance());
        held.dolly(3.0);
        assert!((held.distance() / far - 0.729).abs() < 1e-12);
        held.focus(DVec3::new(5.0, 0.0, 0.0), 1.0);
        let half_angle = (1.0 / held.distance()).asin();
        assert!((half_angle.sin() / 22.5f64.to_radians().sin() - 0.5).abs() < 1e-12);
        let [.., forward] = held.axes();
        let before = held.camera.position;
        held.fly(Flight { forward: 1.0, ..Flight::default() }, 0.1, false);
        assert!((held.camera.position - before - forward * 0.125).length() < 1e-12);
        held.fly(Flight::default(), 0.1, true);
        assert!(held.camera.position.is_finite());
        held.reset();
        assert_eq!(held.camera, home);
    }
}
