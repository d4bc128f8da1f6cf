//! Colored points, and their nearest neighbors.

mod cloud;
mod found;
mod neighbors;

pub use cloud::{PointCloud, SH_C0};
pub use neighbors::{SMALLEST_MEAN_SQUARED_DISTANCE, mean_squared_distance_to_3_nearest};
