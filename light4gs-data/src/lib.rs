//! Cameras, frames, point clouds and dataset readers.
//!
//! [`Scene::open`] turns a folder into cameras with times, a point cloud and an extent. A [`DatasetLayout`] reads one
//! kind of folder, and [`Layouts`] lists those that are known. [`ImageStore`] decodes the images lazily, within a
//! memory bound. [`write_synthetic`] makes a small moving scene for trying things out. Nothing here depends on Burn,
//! and no user input makes this crate panic.
//!
//! Conventions: cameras are OpenCV pinholes
//! (+x right, +y down, +z forward), time is in `[0, 1]`, images are `[H, W, 3]`, row-major,
//! already composited on the background, in the byte values of the file (no gamma handling).

#![forbid(unsafe_code)]

mod atomic;
mod camera;
mod digest;
mod error;
mod exchange;
mod frame;
mod images;
mod layouts;
mod lens;
mod options;
mod orbit;
pub mod ply;
mod points;
mod prepare;
mod programs;
mod pytorch;
mod regular_file;
mod scene;
mod synthetic;

pub use atomic::{is_temporary_name, process_id, sweep_leftovers, write_atomically};
pub use camera::{Camera, Intrinsics, PoseError};
pub use digest::DatasetDigest;
pub use error::DataError;
pub use exchange::{
    GlbOptions, Influence, Joint, JointPose, MotionSample, Skin, glb_bytes, write_four_dgs, write_glb, write_ply_zip,
};
pub use frame::{Frame, Mask, MaskMeaning};
pub use images::{
    ImageStore, PixelMask, Region, RgbImage8, RgbImage32, composite, composite_resized, image_size, regions,
};
pub use layouts::{Colmap, DNerf, DatasetLayout, HyperNerf, Layouts, NerfDs, Nerfstudio, Neu3d};
pub use lens::{Distortion, Lens};
pub use options::{LoadOptions, Resolution};
pub use orbit::orbit_path;
pub use ply::GaussianPly;
pub use points::{PointCloud, SH_C0, SMALLEST_MEAN_SQUARED_DISTANCE, mean_squared_distance_to_3_nearest};
pub use prepare::{PrepareOptions, PrepareProgress, PrepareSummary, prepare};
pub use pytorch::{PlainTensor, read_pytorch};
pub use regular_file::{open_regular_file, read_regular_file, read_regular_text};
pub use scene::{Scene, Split, SplitFrames};
pub use synthetic::{SyntheticOptions, write_synthetic};
