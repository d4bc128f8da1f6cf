//! The stream: written and read back, damaged, refused, and what each of its parts costs.

#[path = "../common/mod.rs"]
mod common;

mod attributes;
mod compressed;
mod damage;
mod files;
mod golden;
mod motion;
mod network_weights;
mod operations;
mod paper_size;
mod planes;
mod random_networks;
mod refusals;
mod round_trip;
