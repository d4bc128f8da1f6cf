//! `[eval]`: what is measured.

use std::path::PathBuf;

use light4gs_data::Split;
use light4gs_keys::Bounds::{Flag, List, Text, Whole};
use light4gs_keys::{ITERATION, choice, keys};

keys! {
    /// Measurements of the decoded file.
    pub struct EvalConfig {
        /// Splits to measure. A split that the dataset does not have is skipped.
        splits: Vec<EvalSplit> = vec![EvalSplit::Test, EvalSplit::Val];
            List { element: &EvalSplit::BOUNDS, length: None }, "ours";
        /// Save every rendered view as a PNG in `renders/`.
        save_renders: bool = true; Flag, "ours";
        /// Frames that are rendered before the measurement of the frame rate begins.
        fps_warmup: usize = 5; Whole { least: 0, most: 1_000_000 }, "ours";
        /// Frames over which the frame rate is measured.
        fps_frames: usize = 50; Whole { least: 1, most: 1_000_000 }, "ours";
        /// Iterations between two measurements of test PSNR during training. 0 means never.
        interval: usize = 1000; ITERATION, "ours";
        /// Number of test views for the measurements of PSNR during training.
        views: usize = 4; ITERATION, "ours";
        /// Files with the weights of LPIPS ([metrics.md](metrics.md)). Without files of weights, LPIPS is not measured,
        /// and the columns of LPIPS say so.
        lpips: Vec<PathBuf> = Vec::new();
            List { element: &Text, length: None }, "ours";
    }
}

choice! {
    /// A split whose images are compared with renders.
    pub enum EvalSplit: "split" {
        /// Frames that are never trained on.
        Test = "test",
        /// Further frames that are never trained on.
        Val = "val",
        /// Frames that are trained on.
        Train = "train",
    }
}

impl From<EvalSplit> for Split {
    fn from(split: EvalSplit) -> Self {
        match split {
            EvalSplit::Test => Self::Test,
            EvalSplit::Val => Self::Val,
            EvalSplit::Train => Self::Train,
        }
    }
}
