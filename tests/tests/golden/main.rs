//! The golden vectors c01 to c13 on every back end. `tests/README.md` describes each.

mod context;
mod dnerf;
mod entropy;
mod geometry;
mod launches;
mod metrics;
mod raster;
mod training;
