//! `[eval]`: how it is measured.

use serde::{Deserialize, Serialize};

/// Views and repetitions of an evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EvalConfig {
    /// Splits that are measured: `test`, `val`, `train`. One that the dataset lacks is passed over.
    pub splits: Vec<String>,
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
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self {
            splits: vec!["test".to_owned(), "val".to_owned()],
            save_renders: true,
            fps_warmup: 5,
            fps_frames: 50,
            interval: 1000,
            views: 4,
        }
    }
}
