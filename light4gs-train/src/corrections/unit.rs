//! What has a correction of its own.

use light4gs_keys::choice;

choice! {
    /// What has a correction of its own.
    pub enum CorrectionUnit: "unit of corrections" {
        /// The dataset is right, and nothing is corrected.
        None = "none",
        /// Each camera of a rig has a correction of its own.
        Camera = "camera",
        /// Each frame has a correction of its own.
        Frame = "frame",
    }
}
