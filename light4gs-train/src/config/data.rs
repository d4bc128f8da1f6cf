//! `[data]`: the training data.

use light4gs_keys::Bounds::{List, NameOrNone, Number, Whole, WholeOrNone};
use light4gs_keys::{SHARE, keys, optional};

use crate::density::MOST_GAUSSIANS;
use light4gs_data::Layouts;

keys! {
    /// Images, and the cloud that training starts from.
    pub struct DataConfig {
        /// Layout of the dataset, such as `dnerf` ([data.md](data.md) has them all). Empty: found by content. `train
        /// --format` sets it.
        #[serde(with = "optional")]
        layout: Option<String> = None;
            NameOrNone { what: "layout", none: "found by content", names: || Layouts::default().names() },
            "ours";
        /// Length of the sequence in frames; later frames are left out. Where the dataset numbers its frames (`neu3d`),
        /// frame `i` has the time `i` divided by this. 0: all frames.
        #[serde(with = "optional")]
        frames: Option<usize> = None;
            WholeOrNone { least: 1, most: 1_000_000 },
            "reference, Neu3D: 300";
        /// Larger images are reduced so that their longer side has this many pixels, keeping their shape. 0 leaves all as
        /// they are. `train --pixels` sets it.
        #[serde(with = "optional")]
        resolution: Option<u32> = None;
            WholeOrNone { least: 8, most: 16_384 }, "ours";
        /// Color behind transparent pixels, each channel 0 to 1.
        background: [f32; 3] = [1.0; 3]; List { element: &SHARE, length: Some(3) }, "reference, D-NeRF: white";
        /// Upper bound of the memory for decoded images. Images that do not fit are decoded again, ahead of the
        /// iterations that need them.
        memory_limit_mib: u64 = 2048; Whole { least: 16, most: 1 << 24 }, "ours";
        /// Number of Gaussians at the start, where the dataset has no point cloud.
        initial_points: usize = 2000; Whole { least: 4, most: MOST_GAUSSIANS }, "reference, D-NeRF";
        /// Half the side of the cube around the origin in which they are scattered, world units.
        initial_box: f32 = 1.3; Number { least: 1e-6, most: 1e6 }, "reference, D-NeRF";
    }
}
