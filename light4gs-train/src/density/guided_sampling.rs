//! Where frames are not explained, Gaussians of a short life are added (guided sampling: Li et al., CVPR 2024).

use light4gs_keys::Bounds::{List, Number, Whole};
use light4gs_keys::{INTERVAL, keys};

keys! {
    /// Guided sampling adds Gaussians at those pixels of training frames that the rendering does not explain. Each new
    /// Gaussian exists only around the time of its frame. Guided sampling is meant for objects that move too fast for
    /// control nodes to follow. Guided sampling needs Gaussians with lifetimes: `model.nodes.lifetime`.
    pub struct GuidedSamplingConfig {
        /// Iterations of the fine stage after which Gaussians are added; empty = never.
        iterations: Vec<usize> = Vec::new();
            List { element: &INTERVAL, length: None }, "after Li et al. 2024";
        /// Number of Gaussians that are added for each point of time with training frames. They are added at pixels of
        /// one random frame of that time. Fewer are added if few pixels are unexplained. The bound
        /// `train.densify.adaptive.max_gaussians` does not apply to the added Gaussians.
        count: usize = 100; Whole { least: 1, most: 1_000_000 }, "ours";
        /// Standard deviation of the added Gaussians' lifetimes. The unit is the mean interval between neighboring
        /// points of time with training frames.
        lifetime: f64 = 0.6; Number { least: 0.01, most: 1e6 }, "ours";
    }
}

impl GuidedSamplingConfig {
    /// Whether Gaussians are added after an iteration of the fine stage.
    pub fn is_due(&self, iteration: usize) -> bool {
        self.iterations.contains(&iteration)
    }
}
