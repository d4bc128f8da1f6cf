//! `[eval]`: how it is measured.

use std::path::PathBuf;

use light4gs_data::Split;
use serde::{Deserialize, Serialize};

use super::choice::choice;

/// Views and repetitions of an evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EvalConfig {
    /// Splits that are measured. One that the dataset lacks is passed over.
    pub splits: Vec<EvalSplit>,
    /// Whether every rendered view is saved as a PNG.
    pub save_renders: bool,
    /// Frames rendered before the clock starts.
    pub fps_warmup: usize,
    /// Frames over which the frame rate is measured.
    pub fps_frames: usize,
    /// While training, test PSNR is measured every so many iterations; 0 means never.
    pub interval: usize,
    /// The number of test views for that.
    pub views: usize,
    /// Files with the weights of LPIPS; without any, the column says that there are none.
    pub lpips: Vec<PathBuf>,
}

choice! {
    /// A split whose images can be compared with.
    pub enum EvalSplit: "split" {
        /// Frames that are never trained.
        Test = "test",
        /// More of them.
        Val = "val",
        /// Frames that are trained.
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

impl Default for EvalConfig {
    fn default() -> Self {
        Self {
            splits: vec![EvalSplit::Test, EvalSplit::Val],
            save_renders: true,
            fps_warmup: 5,
            fps_frames: 50,
            interval: 1000,
            views: 4,
            lpips: Vec::new(),
        }
    }
}
