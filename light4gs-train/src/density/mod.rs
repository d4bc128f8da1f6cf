//! Density strategies decide when Gaussians are cloned, split and pruned.
//!
//! For Gaussians that are added or removed by another rule, write a [`DensityStrategy`]; it changes them with a
//! [`GaussianEditor`]. For another order of pruning alone, write a [`SignificanceScore`].
//!
//! - this file: [`DensityStrategy`], the trainer's interface to a strategy, and [`DensityKind`], the built-in ones by
//!   name
//! - `adaptive`: the strategy of 3DGS, the default
//! - `none`: the number of Gaussians stays that of the cloud
//! - `clone_and_split`, `statistics`: the parts of `adaptive`
//! - `editor`: how a strategy changes the Gaussians, with the optimizer's moments
//! - `significance`: scores by which Gaussians are pruned after densification (paper III-B)

mod adaptive;
pub mod clone_and_split;
mod editor;
mod guided_sampling;
mod none;
pub mod significance;
mod statistics;

use std::collections::BTreeMap;

use burn::tensor::{Device, Int, Tensor};
use light4gs_keys::{choice, keys};
use rand::Rng;

pub use adaptive::{AdaptiveDensityConfig, AdaptiveDensityControl};
pub use editor::GaussianEditor;
pub use guided_sampling::GuidedSamplingConfig;
pub use none::NoDensityControl;
pub use significance::{
    GaussianContributions, PruneConfig, PruneScore, PruneVolume, SignificanceScore, VolumeWeightedScore,
};
pub use statistics::DensityStatistics;

use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

/// The most Gaussians that a configuration may ask for.
pub(crate) const MOST_GAUSSIANS: u64 = 50_000_000;

choice! {
    /// The built-in density strategies, by the names that `train.densify.strategy` takes.
    pub enum DensityKind: "strategy" {
        Adaptive = adaptive: AdaptiveDensityConfig,
        None = none: NoDensityControl,
    }
    /// The keys of the built-in density strategies.
    pub struct DensityStrategies: dyn DensityConfig;
}

keys! {
    /// How Gaussians are added and removed.
    pub struct DensifyConfig {
        /// What decides the number of Gaussians. The keys of each strategy are in the table with the strategy's name.
        strategy: DensityKind = DensityKind::Adaptive;
            DensityKind::BOUNDS, "3DGS";
        /// The keys of the strategies.
        #[serde(flatten)]
        strategies: DensityStrategies;
    }
}

impl DensifyConfig {
    /// The chosen strategy, with its keys.
    pub fn chosen(&self) -> Box<dyn DensityConfig> {
        self.strategies.of(self.strategy)
    }
}

/// The keys of a density strategy.
pub trait DensityConfig {
    /// The strategy that they describe.
    fn strategy(&self) -> Box<dyn DensityStrategy>;

    /// The last iteration of the fine stage after which Gaussians are added; 0 if they never are.
    fn end(&self) -> usize;

    /// Upper bound of the number of Gaussians at whole images, for the estimate of the training time. `None` if it stays
    /// that of the cloud, or if there is no bound.
    fn max_gaussians(&self) -> Option<usize> {
        None
    }

    /// The fault of the keys as a whole, if there is one: one of the keys, and the problem.
    fn problem(&self) -> Option<(&'static str, String)> {
        None
    }
}

/// The position in the training at which a strategy is called.
#[derive(Clone, Copy, Debug)]
pub struct TrainingPosition {
    /// The stage.
    pub stage: Stage,
    /// Iteration of the stage, from 1.
    pub iteration: usize,
    /// Images have `1 / image_factor` of their width and height (`train.coarse_to_fine`).
    pub image_factor: u32,
    /// Extent of the scene, world units: 1.1 times the largest distance of a training camera from their mean.
    pub extent: f32,
    /// Seed of the run.
    pub(crate) seed: u64,
}

impl TrainingPosition {
    /// A generator that depends only on the run's seed, the stage and the iteration, so that a resumed run draws the
    /// same numbers.
    pub fn generator(&self) -> impl Rng + use<> {
        generator(self.seed, Purpose::Split, self.stage, self.iteration)
    }
}

/// The number of Gaussians grows with the side of the images to this power: at twice the size, a surface shows less than
/// four times the detail. From 12 000 Gaussians at 200 pixels it makes 41 000 at 480, about the number chosen by hand.
const GAUSSIANS_BY_SIDE: f64 = 1.4;

/// The number of Gaussians for images of `ratio` times the side, if `count` suit the present ones; at least 1.
pub(crate) fn gaussians_for_images(count: usize, ratio: f64) -> usize {
    (count as f64 * ratio.powf(GAUSSIANS_BY_SIDE)).round().max(1.0) as usize
}

/// Statistics of the `N` Gaussians from a differentiated view. No tensor is on a tape.
#[derive(Clone, Debug)]
pub struct ViewStatistics {
    /// `[N, 2]`: gradient of the view's loss with respect to the projected positions, in units of half the image.
    /// `None` if nothing was on the screen.
    pub screen_gradient: Option<Tensor<2>>,
    /// `[N]` in pixels: three standard deviations, rounded up; 0 outside the image; -1 for Gaussians that cannot be drawn.
    pub radii: Tensor<1, Int>,
}

/// Decides when Gaussians are added and removed. The trainer calls the hooks in this order in every iteration:
/// [`after_backward`](Self::after_backward), the optimizer's step, [`after_step`](Self::after_step).
///
/// A strategy keeps its own statistics. State that must be in checkpoints is returned by [`state`](Self::state) and set
/// by [`restore`](Self::restore), so that a resumed run is the same to the last bit.
pub trait DensityStrategy: Send {
    /// Called when a stage begins with `count` Gaussians: statistics start again. `device` is without autodiff. Not
    /// called when a run is resumed in the middle of a stage; then [`restore`](Self::restore) is.
    fn begin_stage(&mut self, count: usize, device: &Device);

    /// Called after the views of an iteration have been differentiated, for gathering statistics.
    fn after_backward(&mut self, views: &[ViewStatistics], position: &TrainingPosition);

    /// Called after the optimizer's step, for cloning, splitting, pruning and resetting.
    fn after_step(&mut self, gaussians: &mut GaussianEditor, position: &TrainingPosition);

    /// Called when other code, such as pruning by significance, has kept only the rows where `keep` is set. `[N]`
    fn rows_kept(&mut self, keep: &[bool]);

    /// Whether the number of Gaussians is final for the stage after this iteration. From then on the rate includes
    /// spherical harmonics.
    fn is_over(&self, stage: Stage, iteration: usize) -> bool;

    /// The state for a checkpoint, by name: vectors without a tape.
    fn state(&self) -> BTreeMap<String, Tensor<1>>;

    /// Sets the state to what [`state`](Self::state) returned.
    ///
    /// # Errors
    /// As text: what is missing, or has another size.
    fn restore(&mut self, state: BTreeMap<String, Tensor<1>>, count: usize) -> Result<(), String>;
}
