//! Datasets and files of other programs: cameras, images, point clouds, Gaussians.
//!
//! A dataset is a folder with images and their cameras. [`Scene::open`] reads its metadata: cameras with times, a point cloud
//! and an extent. [`ImageStore`] decodes the images when they are needed. Nothing here depends on Burn.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | open a dataset of a known layout | [`Scene::open`] with [`LoadOptions`] |
//! | read a layout of your own | a [`DatasetLayout`], added to [`Layouts`] |
//! | make a dataset from videos | [`prepare`], which runs `ffmpeg` and `colmap` |
//! | take a window of a long capture | [`Scene::between`], [`Scene::thinned`] |
//! | try things out without a dataset | [`write_synthetic`]: a small moving scene |
//! | the same for a minute and longer | [`write_take`]: a room in which things come and go |
//! | decode images within a memory bound | [`ImageStore`] |
//! | take metrics over parts of an image | [`regions`] |
//! | see what a dataset is taken for | [`CaptureSummary`] |
//! | see what makes a capture hard | [`camera_curves`], [`capture_faults`] |
//! | find cameras of a rig that are out of step | [`out_of_step`] |
//! | notice that a dataset has changed | [`DatasetDigest`] |
//! | tell whether a folder is a whole copy of a published scene | [`KnownCopy`] |
//! | make a camera, or a path of cameras | [`Camera::look_at`], [`orbit_path`] |
//! | undo the distortion of a lens | nothing: [`ImageStore`] does it; [`Lens`] is the model |
//! | read or write point clouds and Gaussians as PLY | [`PointCloud`], [`GaussianPly`], [`ply`] |
//! | write Gaussians for other players | [`write_glb`], [`write_four_dgs`], [`write_ply_zip`] |
//! | read tensors of PyTorch, without executing anything | [`read_pytorch`] |
//! | write a file whole or not at all | [`write_atomically`] |
//!
//! **In short:** [`Scene::open`] and [`ImageStore`] suffice for training.
//!
//! # Example
//!
//! ```
//! use light4gs_data::{ImageStore, LoadOptions, Scene, SyntheticOptions, write_synthetic};
//!
//! # let folder = tempfile::tempdir().unwrap();
//! let root = folder.path().join("scene");
//! let synthetic = SyntheticOptions { resolution: 16, train_frames: 3, test_frames: 1, ..Default::default() };
//! write_synthetic(&root, &synthetic)?;
//!
//! let options = LoadOptions::default();
//! let scene = Scene::open(&root, &options)?; // metadata only
//! assert_eq!(scene.layout, "dnerf");
//! assert_eq!(scene.train.iter().map(|frame| frame.time).collect::<Vec<_>>(), [0.0, 0.5, 1.0]);
//!
//! let images = ImageStore::new(&options, 1 << 20); // at most 1 MiB in memory
//! let image = images.get(&scene.train[0])?; // decoded now
//! assert_eq!((image.width, image.height, image.pixels.len()), (16, 16, 16 * 16 * 3));
//! # Ok::<(), light4gs_data::DataError>(())
//! ```
//!
//! # Conventions
//!
//! - Cameras are OpenCV pinholes: +x right, +y down, +z forward. Focal lengths and principal points are in pixels.
//! - Time is in `[0, 1]`; [`Scene::seconds`] says how long that is, where it is known.
//! - Images are `[H, W, 3]`, row-major, already composited on the background, in the byte values of the file (no gamma
//!   handling).
//!
//! # Limits
//!
//! No user input makes this crate panic, and memory is taken only for bytes that are there. An error names the file, the
//! field, what was expected and the remedy. Images of captures have at most 2^26 pixels when they are used.
#![forbid(unsafe_code)]

mod atomic;
mod camera;
mod curves;
mod digest;
mod duration;
mod error;
mod exchange;
mod faults;
mod frame;
mod images;
mod jumps;
mod known;
mod layouts;
mod lens;
mod numbered;
mod options;
mod orbit;
pub mod ply;
mod points;
mod posing;
mod prepare;
mod programs;
mod pytorch;
mod regular_file;
mod scene;
mod summary;
mod synchrony;
mod synthetic;
mod window;

pub use atomic::{is_temporary_name, process_id, sweep_leftovers, write_atomically};
pub use camera::{Camera, Intrinsics, PoseError};
pub use curves::{CameraCurve, camera_curves};
pub use digest::DatasetDigest;
pub use error::DataError;
pub use exchange::{
    GlbOptions, Influence, Joint, JointPose, MotionSample, Skin, glb_bytes, write_four_dgs, write_glb, write_ply_zip,
};
pub use faults::capture_faults;
pub use frame::{Frame, Mask, MaskMeaning};
pub use images::{
    ImageStore, PixelMask, Region, RgbImage8, RgbImage32, composite, composite_resized, image_size, regions,
};
pub use jumps::turn_between_frames;
pub use known::KnownCopy;
pub use layouts::{Colmap, DNerf, DatasetLayout, HyperNerf, Layouts, NerfDs, Nerfstudio, Neu3d};
pub use lens::{Distortion, Lens};
pub use numbered::NumberedFiles;
pub use options::{CamerasFrom, LoadOptions, Resolution, TimesFrom};
pub use orbit::orbit_path;
pub use ply::GaussianPly;
pub use points::{PointCloud, SH_C0, SMALLEST_MEAN_SQUARED_DISTANCE, mean_squared_distance_to_3_nearest};
pub use prepare::{PrepareEvent, PrepareOptions, PrepareSummary, prepare};
pub use pytorch::{PlainTensor, read_pytorch};
pub use regular_file::{open_regular_file, read_regular_file, read_regular_text};
pub use scene::{Reading, Scene, Split, SplitFrames};
pub use summary::{CaptureFact, CaptureSummary};
pub use synchrony::{OutOfStep, out_of_step};
pub use synthetic::{SyntheticOptions, TakeOptions, write_synthetic, write_take};
