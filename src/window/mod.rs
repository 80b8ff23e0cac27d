//! The window: fly through a scene, move lights, change materials, and see global illumination follow.
//!
//! ```text
//! keys, mouse, panel, file ─► State ─► Request ─► Pane: front worker │ back worker │ refiner ─► Frame ─► present.frag
//!                                                        (moves)       (builds)      (rests)
//! ```
//!
//! The window's thread handles input and paints what is finished; it never renders and never waits. Each *worker* has a
//! thread and a GL context of its own that shares textures with the window's: it draws the latest [`Request`] within
//! the frame budget while things move ([`ladder`]), and refines it pass by pass when they rest, with the passes of
//! [`crate::pipeline::progressive`]. What needs programs that are not built yet goes to a second worker, and comes to the front
//! with its first picture; final gathering has a third one, whose passes are shown once they are better than what moved.

pub mod history;
pub mod keys;
pub mod ladder;
pub mod level;
pub mod markers;
pub mod orbit;
pub mod percentiles;
pub mod pick;
pub mod replay;
pub mod save;
pub mod script;
pub mod watch;

mod app;
mod driver_lock;
mod engine;
mod events;
mod exchange;
mod input;
mod job;
mod journal;
mod open;
mod overlay;
mod painting;
mod pane;
mod panel;
mod player;
mod recent_costs;
mod request;
mod screen;
mod state;
mod summary;
mod thread;
mod worker;

pub use app::run;
pub use journal::left_over;
pub use request::{Key, Request};

pub use summary::{Options, Summary};
