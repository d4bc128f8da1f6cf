//! What has a correction of its own.

use light4gs_keys::choice;

choice! {
    /// What has a correction of its own.
    pub enum CorrectionUnit: "unit of corrections" {
        /// No corrections: the dataset is right.
        None = "none",
        /// Each camera of a rig.
        Camera = "camera",
        /// Each frame.
        Frame = "frame",
    }
}
