//! `[data]`: what is trained on.

use serde::{Deserialize, Serialize};

use super::optional;

/// Images and the cloud that training starts from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DataConfig {
    /// The dataset's layout, such as `neu3d`; `None` (empty in TOML) finds it by content.
    #[serde(with = "optional")]
    pub layout: Option<String>,
    /// Length of the sequence in frames: later ones are left out. `None` (0 in TOML) takes all.
    #[serde(with = "optional")]
    pub frames: Option<usize>,
    /// Images are resized to this width; `None` (0 in TOML) leaves them as they are.
    #[serde(with = "optional")]
    pub resolution: Option<u32>,
    /// Color behind transparent pixels, each channel in [0, 1].
    pub background: [f32; 3],
    /// Upper bound of the memory that decoded images may take, in MiB.
    pub memory_limit_mib: u64,
    /// Number of Gaussians to start from where the dataset brings no point cloud.
    pub initial_points: usize,
    /// Half the side of the cube in which those are scattered, in world units.
    pub initial_box: f32,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            layout: None,
            frames: None,
            resolution: None,
            background: [1.0; 3],
            memory_limit_mib: 2048,
            initial_points: 2000,
            initial_box: 1.3,
        }
    }
}
