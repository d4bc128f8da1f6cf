//! What has a correction of its own.

use light4gs_keys::choice;

choice! {
    /// What has a correction of its own.
    pub enum CorrectionUnit: "unit of corrections" {
        /// Nothing is corrected: the values of the dataset are used as they are.
        None = "none",
        /// Each camera of a rig has a correction of its own.
        Camera = "camera",
        /// Each frame has a correction of its own.
        Frame = "frame",
    }
}
