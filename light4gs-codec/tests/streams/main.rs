//! The stream: writing and reading, damage, refusals, and the bytes of each part.

#[path = "../common/mod.rs"]
mod common;

mod attributes;
mod compressed;
mod conformance;
mod damage;
mod files;
mod golden;
mod layers;
mod motion;
mod motion_over_time;
mod network_weights;
mod operations;
mod paper_size;
mod planes;
mod random_networks;
mod refusals;
mod round_trip;
