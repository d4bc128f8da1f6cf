//! Colored points: reading and finding them, their nearest neighbors, and points that are left out.

mod cloud;
mod found;
mod neighbors;
mod outliers;

pub use cloud::{PointCloud, SH_C0};
pub use neighbors::{SMALLEST_MEAN_SQUARED_DISTANCE, mean_squared_distance_to_3_nearest};
