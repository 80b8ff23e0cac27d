//! The window itself, in a display without a screen (Xvfb), with a hand on mouse and keyboard (xdotool). The tests see
//! what a person would: pixels, titles, files; and the summary that the program prints when it closes.
//!
//! Without Xvfb or xdotool they are skipped; with PHOTILE_REQUIRE_DRIVERS=1, as in CI, they fail instead.

mod controls;
pub mod display;
mod gaps;
mod pictures;
mod scene_file;
mod screens;
mod scripts;
