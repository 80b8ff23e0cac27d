//! Direct light, from the scene file to the image, on every backend that is there.

mod agreement;
mod analytic;
mod changes;
mod command_line;
mod edges;
mod moved;
mod permutations;
mod photon_commands;
mod random;
mod references;
