//! Training of dynamic scenes: the loop and its parts, compression, runs, and the evaluation of files.
//!
//! A run takes a [`Config`](config::Config) and a [`Scene`](light4gs_data::Scene), trains Gaussians and their motion, and
//! ends with one `.l4gs` file. Every part of the loop can be replaced without a change of this crate.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | train a dataset | a preset of [`Config`](config::Config), then [`Trainer::builder`](trainer::Trainer::builder) and [`Trainer::run`](trainer::Trainer::run) |
//! | keep checkpoints, stop, resume | a [`RunFolder`](run::RunFolder) for the builder, [`TrainerBuilder::resume`](trainer::TrainerBuilder::resume) |
//! | train images that are in memory | [`MemoryImages`](dataset::MemoryImages), or an [`ImageSource`](dataset::ImageSource) |
//! | use a loss, frames, densification or pruning of your own | [`Loss`](loss::Loss), [`FrameSampler`](sampling::FrameSampler), [`DensityStrategy`](density::DensityStrategy), [`SignificanceScore`](density::SignificanceScore) |
//! | correct exposures, poses and times that a dataset has wrong | `train.exposure`, `train.poses`, `train.time_offsets`; [`corrections`] |
//! | add a term to the loss | [`Regularizer`](regularizer::Regularizer) |
//! | use another model of motion | [`Trainer::builder_with_field`](trainer::Trainer::builder_with_field) |
//! | use entropy models of your own | [`EntropyModels`](compression::EntropyModels) |
//! | follow a run: logs, progress, images | [`Observer`](observers::Observer); [`ViewSource`](view_source::ViewSource) gives a viewer its newest state |
//! | train a capture of minutes as a base and segments | [`take`] |
//! | measure a file | [`DecodedScene`](evaluation::DecodedScene), [`metrics`] |
//! | make a file of a scene that another program has trained | [`import`], then [`code_scene`](compression::code_scene) |
//! | know beforehand how long a training takes | [`Pace`](pace::Pace) |
//! | fit a configuration to other images, a time or a size | the methods `for_...` of [`Config`](config::Config) |
//!
//! **In short:** [`Config`](config::Config) and [`Trainer`](trainer::Trainer) suffice for training. A training loop of your
//! own needs `light4gs-model` alone.
//!
//! # Example
//!
//! One coarse and two fine iterations on a small synthetic scene. [`Trainer`](trainer::Trainer) shows the same with images in
//! memory and another loss.
//!
//! ```
//! use light4gs_data::{Scene, Split, SyntheticOptions, write_synthetic};
//! use light4gs_train::config::{Config, DeviceName};
//! use light4gs_train::dataset::load_options;
//! use light4gs_train::trainer::Trainer;
//!
//! # let folder = tempfile::tempdir().unwrap();
//! let root = folder.path().join("scene");
//! let synthetic = SyntheticOptions { resolution: 32, train_frames: 4, test_frames: 1, val_frames: 0, seed: 0 };
//! write_synthetic(&root, &synthetic)?;
//!
//! let mut config = Config::from_preset("hexplane-dnerf-cpu")?;
//! config.device = DeviceName::Flex;
//! config.train.coarse_iterations = 1;
//! config.train.fine_iterations = 2;
//! config.train.prune.fraction = 0.0;
//! let data = Scene::open(&root, &load_options(&config))?;
//! let mut trainer = Trainer::builder(config, data).build()?;
//! while let Some(step) = trainer.step()? {
//!     println!("{} stage, iteration {}: loss {}", step.stage, step.iteration, step.loss);
//! }
//! assert!(trainer.psnr(Split::Test)?.is_finite());
//! # Ok::<(), light4gs_train::error::TrainError>(())
//! ```
//!
//! # Conventions
//!
//! - Iterations count from 1 in each [`Stage`].
//! - All random numbers follow from the seed of the configuration and the iteration. On a CPU the same run gives the same
//!   bytes, also if it was interrupted.
//! - `[N]`, `[H, W, 3]` and the like are shapes of tensors: `N` Gaussians, an image of `H` rows and `W` columns.

pub mod compression;
pub mod config;
pub mod corrections;
pub mod dataset;
pub mod density;
pub mod device;
pub mod divergence;
pub mod error;
pub mod evaluation;
pub mod import;
pub mod loss;
pub mod memory;
pub mod metrics;
pub mod observers;
pub mod optimization;
pub mod pace;
pub mod provenance;
mod randomness;
pub mod regularizer;
pub mod run;
pub mod sampling;
mod stage;
pub mod table;
pub mod take;
pub mod trainer;
pub mod utc;
pub mod view_source;

pub use stage::Stage;
