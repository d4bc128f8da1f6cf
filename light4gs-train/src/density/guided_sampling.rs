//! Where frames are not explained, Gaussians of a short life are added (guided sampling: Li et al., CVPR 2024).

use light4gs_keys::Bounds::{List, Number, Whole};
use light4gs_keys::{INTERVAL, keys};

keys! {
    /// Guided sampling: adds Gaussians at pixels of the training frames that the rendering does not explain. Each of them
    /// exists around the time of its frame only, for objects that are too fast to be followed. Gaussians need lifetimes:
    /// `model.nodes.lifetime`.
    pub struct GuidedSamplingConfig {
        /// Iterations of the fine stage after which Gaussians are added; empty = never.
        iterations: Vec<usize> = Vec::new();
            List { element: &INTERVAL, length: None }, "after Li et al. 2024";
        /// New Gaussians for each training time, at pixels of one of its frames; fewer where few pixels are unexplained.
        /// They may exceed `train.densify.adaptive.max_gaussians`.
        count: usize = 100; Whole { least: 1, most: 1_000_000 }, "ours";
        /// Lifetime of the new Gaussians: its standard deviation, in distances between training times.
        lifetime: f64 = 0.6; Number { least: 0.01, most: 1e6 }, "ours";
    }
}

impl GuidedSamplingConfig {
    /// Whether Gaussians are added after an iteration of the fine stage.
    pub fn is_due(&self, iteration: usize) -> bool {
        self.iterations.contains(&iteration)
    }
}
