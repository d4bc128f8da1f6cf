//! Cameras, frames, point clouds and dataset readers.
//!
//! [`Scene::open`] turns a folder into cameras with times, a point cloud and an extent;
//! [`ImageStore`] decodes the pictures lazily, within a memory bound;
//! [`write_synthetic`] makes a small moving scene to try things on.
//! Nothing here depends on Burn, and no user input makes this crate panic.
//!
//! Conventions: cameras are OpenCV pinholes
//! (+x right, +y down, +z forward), time is in `[0, 1]`, pictures are `[H, W, 3]`, row-major,
//! already composited on the background, in the byte values of the file (no gamma handling).

pub mod atomic;
pub mod camera;
pub mod composite;
pub mod dnerf;
pub mod error;
pub mod frame;
pub mod gaussian_ply;
mod json;
pub mod loader;
pub mod neighbors;
pub mod orbit;
pub mod ply;
pub mod point_cloud;
pub mod scene;
pub mod synthetic;

pub use camera::{Camera, PoseError};
pub use error::DataError;
pub use frame::{Frame, RgbImage8, RgbImage32};
pub use gaussian_ply::GaussianPly;
pub use loader::ImageStore;
pub use orbit::orbit_path;
pub use point_cloud::PointCloud;
pub use scene::{Format, LoadOptions, Resolution, Scene, Split};
pub use synthetic::{SyntheticOptions, write_synthetic};
