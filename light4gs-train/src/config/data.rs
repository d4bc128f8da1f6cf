//! `[data]`: the training data.

use light4gs_keys::Bounds::{Flag, List, NameOrNone, Number, Whole, WholeOrNone};
use light4gs_keys::{SHARE, choice, keys, optional};

use crate::density::MOST_GAUSSIANS;
use light4gs_data::{CamerasFrom, Layouts, TimesFrom};

choice! {
    /// How times follow from the images' names, where the files give none.
    #[derive(Default)]
    pub enum TimesKind: "source of times" {
        /// A date with a time of day in the images' names, otherwise the last number in the names, otherwise the order
        /// of the names.
        #[default]
        Auto = "auto",
        /// The last number in the images' names.
        Number = "number",
        /// The images of each camera are sorted by name, with numbers in numerical order; the time is the image's place
        /// in this order.
        Order = "order",
    }
}

choice! {
    /// How cameras follow from the images' names, in layouts that do not name cameras.
    #[derive(Default)]
    pub enum CamerasKind: "source of cameras" {
        /// Images are from the same camera if they are in the same folder and their names differ only in the part that
        /// counts the time.
        #[default]
        Auto = "auto",
        /// There is one camera, which moves.
        One = "one",
        /// Each folder is a camera.
        Folder = "folder",
    }
}

impl From<TimesKind> for TimesFrom {
    fn from(kind: TimesKind) -> Self {
        match kind {
            TimesKind::Auto => Self::Auto,
            TimesKind::Number => Self::Number,
            TimesKind::Order => Self::Order,
        }
    }
}

impl From<CamerasKind> for CamerasFrom {
    fn from(kind: CamerasKind) -> Self {
        match kind {
            CamerasKind::Auto => Self::Auto,
            CamerasKind::One => Self::One,
            CamerasKind::Folder => Self::Folder,
        }
    }
}

keys! {
    /// Images, and the cloud that training starts from.
    pub struct DataConfig {
        /// Layout of the dataset, such as `dnerf`; [data.md](data.md) has all layouts. If empty, the layout is found by
        /// content. `train --format` sets this key.
        #[serde(with = "optional")]
        layout: Option<String> = None;
            NameOrNone { what: "layout", none: "found by content", names: || Layouts::default().names() },
            "ours";
        /// Only for the layout `neu3d`: length of the sequence in frames. Later frames are left out, and frame `i` has
        /// the time `i` divided by this length. 0 means all frames.
        #[serde(with = "optional")]
        frames: Option<usize> = None;
            WholeOrNone { least: 1, most: 1_000_000 },
            "reference, Neu3D: 300";
        /// Frames per second of the capture. The length of the capture in seconds follows from this frame rate. If the
        /// number is below 0.001, the frame rate is the one that the capture's files state, if they state one.
        frames_a_second: f64 = 0.0; Number { least: 0.0, most: 1e5 }, "ours";
        /// First and last time of the images that are used, as shares of the capture's length. In the run of a take's
        /// segment, these are the times on which the segment is trained.
        between: [f64; 2] = [0.0, 1.0]; List { element: &SHARE, length: Some(2) }, "ours";
        /// Training uses frames of at most this number of different times, which are spread evenly over the capture. 0
        /// means that all times are used.
        #[serde(with = "optional")]
        most_times: Option<usize> = None; WholeOrNone { least: 1, most: 1_000_000 }, "ours";
        /// Largest number of pixels of an image's longer side; larger images are scaled down to it and keep their
        /// aspect ratio. 0 leaves all images as they are. `train --pixels` sets this key.
        #[serde(with = "optional")]
        resolution: Option<u32> = None;
            WholeOrNone { least: 8, most: 16_384 }, "ours";
        /// Color behind transparent pixels, each channel 0 to 1.
        background: [f32; 3] = [1.0; 3]; List { element: &SHARE, length: Some(3) }, "reference, D-NeRF: white";
        /// Where the times of images come from, if a dataset in the layout `colmap` or `nerfstudio` has no times.
        /// `light4gs check` prints which of the sources listed here was used.
        times: TimesKind = TimesKind::Auto; TimesKind::BOUNDS, "ours";
        /// How images are grouped into cameras, in the layouts `colmap` and `nerfstudio`.
        cameras: CamerasKind = CamerasKind::Auto; CamerasKind::BOUNDS, "ours";
        /// Whether the times of a rig's camera are shifted if this camera is some frames ahead of the other cameras, or
        /// behind them. If off, `train` and `check` only report such cameras.
        synchronize: bool = false; Flag, "ours";
        /// Upper bound of the memory for decoded images. Images that do not fit are decoded again, ahead of the
        /// iterations that need them.
        memory_limit_mib: u64 = 2048; Whole { least: 16, most: 1 << 24 }, "ours";
        /// Number of Gaussians at the start, where the dataset has no point cloud.
        initial_points: usize = 2000; Whole { least: 4, most: MOST_GAUSSIANS }, "reference, D-NeRF";
        /// Half the side, in world units, of the cube around the origin in which the initial Gaussians are scattered,
        /// if the dataset has no point cloud.
        initial_box: f32 = 1.3; Number { least: 1e-6, most: 1e6 }, "reference, D-NeRF";
    }
}
