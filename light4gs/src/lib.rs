//! The libraries of Light4GS under one name, and the command line of the program `light4gs`.
//!
//! # Which of these do I need?
//!
//! | task | use |
//! |---|---|
//! | read, write or check `.l4gs` files, without Burn and without a GPU | [`codec`] |
//! | read datasets, cameras, images and point clouds | [`data`] |
//! | draw a decoded scene on the CPU, without Burn | [`render`] |
//! | differentiate: dynamic scenes, splatting and entropy models as Burn modules | [`model`] |
//! | train, evaluate, or plug in a part of your own | [`train`] |
//! | run the program from a program of your own | `cli`, with the feature `cli` |
//!
//! The front page of each says which of its parts serve which task. A crate that extends Light4GS needs one line in its
//! `Cargo.toml`, without the command line and with the back ends that it wants: `flex` and `ndarray` compute on the
//! processor, `wgpu` on a graphics adapter.
//!
//! ```toml
//! light4gs = { version = "0.1", default-features = false, features = ["flex"] }
//! ```
//!
//! # Example
//!
//! This line gives all libraries: four Gaussians that follow a deformation field, and their file.
//!
//! ```
//! use light4gs::codec::{self, SceneMeta};
//! use light4gs::data::PointCloud;
//! use light4gs::train::config::Config;
//! use light4gs::train::device;
//!
//! let config = Config::from_preset("dnerf")?;
//! let positions = vec![[0.0; 3], [0.5, 0.0, 0.2], [0.1, 0.4, 0.1], [0.3, 0.2, -0.3]];
//! let cloud = PointCloud { positions, colors: vec![[0.8, 0.4, 0.1]; 4] };
//! let scene = config.model.build().init(&cloud, &device::any()?);
//! let bytes = codec::encode(&scene.to_arrays(SceneMeta::default())?)?;
//! assert_eq!(codec::decode(&bytes)?.gaussians.len(), 4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "cli")]
mod video;

pub use light4gs_codec as codec;
pub use light4gs_data as data;
pub use light4gs_model as model;
pub use light4gs_render as render;
pub use light4gs_train as train;
