//! How many Gaussians there are: when they are cloned, split and pruned.
//!
//! - here: [`DensityStrategy`], what the trainer asks of a strategy, and [`DensityKind`], the built-in ones by name
//! - `adaptive`: the strategy of 3DGS, the default
//! - `none`: the Gaussians of the cloud stay as many as they are
//! - `clone_and_split`, `statistics`: its parts
//! - `editor`: how a strategy changes the Gaussians, with the optimizer's moments in step
//! - `significance`: scores by which Gaussians are pruned after densification (paper III-B)

mod adaptive;
pub mod clone_and_split;
mod editor;
mod none;
pub mod significance;
mod statistics;

use std::collections::BTreeMap;

use burn::tensor::{Device, Int, Tensor};
use rand::Rng;

pub use adaptive::{AdaptiveDensityConfig, AdaptiveDensityControl};
pub use editor::GaussianEditor;
pub use none::NoDensityControl;
pub use significance::{
    GaussianContributions, PruneConfig, PruneScore, PruneVolume, SignificanceScore, VolumeWeightedScore,
};
pub use statistics::DensityStatistics;

use crate::keys::Bounds::Kind;
use crate::keys::{keys, kinds};
use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

kinds! {
    /// The built-in density strategies, by the names that `train.densify.strategy` takes.
    pub enum DensityKind: "strategy" {
        Adaptive = adaptive: AdaptiveDensityConfig,
        None = none: NoDensityControl,
    }
    /// The keys of the built-in density strategies.
    pub struct DensityStrategies: dyn DensityConfig;
}

keys! {
    /// How Gaussians come and go.
    pub struct DensifyConfig {
        /// The strategy: `"adaptive"` clones, splits and prunes, `"none"` keeps the Gaussians of the cloud. The keys of each
        /// stand in a table of its name.
        strategy: DensityKind = DensityKind::Adaptive;
            Kind { names: DensityKind::NAMES, list: "light4gs-train/src/density/mod.rs" },
            "3DGS", "or \"none\"";
        /// The keys of the strategies.
        #[serde(flatten)]
        strategies: DensityStrategies;
    }
}

impl DensifyConfig {
    /// The strategy that is chosen, with its keys.
    pub fn chosen(&self) -> Box<dyn DensityConfig> {
        self.strategies.of(self.strategy)
    }
}

/// The keys of a density strategy.
pub trait DensityConfig {
    /// The strategy that they describe.
    fn strategy(&self) -> Box<dyn DensityStrategy>;

    /// The last iteration of the fine stage after which Gaussians come; 0 if they never do.
    fn end(&self) -> usize;

    /// What is wrong with the keys together, if something is: one of them, and what about it.
    fn problem(&self) -> Option<(&'static str, String)> {
        None
    }
}

/// The position in the training at which a strategy is asked.
#[derive(Clone, Copy, Debug)]
pub struct TrainingPosition {
    /// The stage.
    pub stage: Stage,
    /// Iteration of the stage, from 1.
    pub iteration: usize,
    /// Radius of the cameras' positions, world units: what "large" is measured by.
    pub extent: f32,
    /// Of the run.
    pub(crate) seed: u64,
}

impl TrainingPosition {
    /// A generator that depends on the run's seed, the stage and the iteration alone, so that a run that was resumed
    /// draws the same numbers.
    pub fn generator(&self) -> impl Rng + use<> {
        generator(self.seed, Purpose::Split, self.stage, self.iteration)
    }
}

/// What a differentiated view says about the `N` Gaussians. All tensors are off the tape.
#[derive(Clone, Debug)]
pub struct ViewStatistics {
    /// `[N, 2]`: gradient of the view's loss by the projected positions, in units of half the image. None where nothing
    /// was on the screen.
    pub screen_gradient: Option<Tensor<2>>,
    /// `[N]` in pixels: three standard deviations, rounded up; 0 outside the image; -1 for Gaussians that cannot be drawn.
    pub radii: Tensor<1, Int>,
}

/// Decides how many Gaussians there are. The trainer calls the hooks in this order in every iteration:
/// [`after_backward`](Self::after_backward), the optimizer's step, [`after_step`](Self::after_step).
///
/// A strategy has its statistics for itself. What must survive a checkpoint goes through [`state`](Self::state) and
/// [`restore`](Self::restore), so that a resumed run is the same to the last bit.
pub trait DensityStrategy: Send {
    /// A stage begins with `count` Gaussians: statistics begin anew. `device` is without autodiff. Not called when a run
    /// is resumed in the middle of a stage; [`restore`](Self::restore) is.
    fn begin_stage(&mut self, count: usize, device: &Device);

    /// The views of an iteration have been differentiated: the place to gather statistics.
    fn after_backward(&mut self, views: &[ViewStatistics], position: &TrainingPosition);

    /// The optimizer has made its step: the place to clone, split, prune and reset.
    fn after_step(&mut self, gaussians: &mut GaussianEditor, position: &TrainingPosition);

    /// Somebody else, such as pruning by significance, has kept the rows where `keep` is set. `[N]`
    fn rows_kept(&mut self, keep: &[bool]);

    /// Whether the strategy is done with the stage: Gaussians neither come nor go any more after this iteration. From then
    /// on spherical harmonics have a part in the rate.
    fn is_over(&self, stage: Stage, iteration: usize) -> bool;

    /// What a checkpoint must hold, by name: vectors off the tape.
    fn state(&self) -> BTreeMap<String, Tensor<1>>;

    /// Takes back what [`state`](Self::state) gave.
    ///
    /// # Errors
    /// What is missing or of another size, in words.
    fn restore(&mut self, state: BTreeMap<String, Tensor<1>>, count: usize) -> Result<(), String>;
}
