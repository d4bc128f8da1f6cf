//! The multiscale hexplane (HexPlane, Cao and Johnson 2023; multiscale as in K-Planes and 4DGS): a plane over each pair of
//! axes at every scale.

use burn::tensor::Device;
use light4gs_codec::plane_layout::{AXIS_NAMES, IllegalSize, PlaneAxes, PlaneLayout, check_resolution};
use light4gs_keys::Bounds::{List, Whole};
use light4gs_keys::keys;

use super::FeaturePlanes;

/// Most cells along an axis, far above anything useful: a mistyped number must not ask for the machine's whole memory.
pub const MOST_PLANE_RESOLUTION: usize = 4096;

keys! {
    /// Sizes of the multiscale hexplane.
    pub struct HexPlaneConfig {
        /// Number of channels of each plane: a plane holds this many numbers at each of its points.
        channels: usize = 32; Whole { least: 1, most: 1024 }, "paper: 32 for D-NeRF, 16 for real scenes";
        /// Resolution of the planes along x, y, z and t, before `multipliers` are applied. Each number is a multiple of
        /// 4.
        resolution: [usize; 4] = [64, 64, 64, 24];
            List { element: &Whole { least: 4, most: MOST_PLANE_RESOLUTION as u64 }, length: Some(4) },
            "paper; its 25 time steps are no multiple of 4";
        /// Ascending numbers, one for each scale of planes. The spatial resolution of a scale is `resolution` times the
        /// number of this scale; the resolution in time is the same at all scales.
        multipliers: Vec<usize> = vec![1, 2];
            List { element: &Whole { least: 1, most: MOST_PLANE_RESOLUTION as u64 / 4 }, length: None }, "paper";
    }
}

impl HexPlaneConfig {
    /// The configuration of given planes; `None` if they are no hexplane.
    pub fn of(planes: &FeaturePlanes) -> Option<Self> {
        let layout = planes.layout();
        let lowest = &layout.planes()[layout.scale(0)];
        let mut resolution = [0; AXIS_NAMES.len()];
        for (axis, cells) in resolution.iter_mut().enumerate() {
            *cells = lowest.iter().find_map(|plane| plane.cells_along(axis))?;
        }
        let width = |scale: usize| Some(layout.planes()[layout.find(scale, PlaneAxes::Xy)?].size[1]);
        let multipliers = (0..layout.scales()).map(|scale| Some(width(scale)? / resolution[0]));
        let config = Self { channels: planes.channels(), resolution, multipliers: multipliers.collect::<Option<_>>()? };
        (config.layout() == *layout).then_some(config)
    }

    /// The planes.
    pub fn layout(&self) -> PlaneLayout {
        PlaneLayout::multiscale(&PlaneAxes::ALL, self.resolution, &self.multipliers)
    }

    /// Whether there can be planes of this resolution. Codec and context model have the same requirements.
    ///
    /// # Errors
    /// Names the axis and the nearest legal size.
    pub fn check(&self) -> Result<(), IllegalSize> {
        check_resolution(self.resolution)
    }

    /// Planes with their initial values; see [`FeaturePlanes::init`].
    ///
    /// ```
    /// use burn::tensor::{Device, Tensor};
    /// use light4gs_model::HexPlaneConfig;
    ///
    /// let device = Device::flex();
    /// let config = HexPlaneConfig { channels: 4, resolution: [8, 8, 8, 4], ..HexPlaneConfig::default() };
    /// let points = Tensor::<2>::zeros([10, 4], &device);
    /// assert_eq!(config.init(&device).query(points).dims(), [10, 4 * 2]);
    /// ```
    ///
    /// # Panics
    /// If [`Self::check`] refuses the resolution.
    pub fn init(&self, device: &Device) -> FeaturePlanes {
        if let Err(problem) = self.check() {
            panic!("the planes' resolution is {problem}");
        }
        FeaturePlanes::init(&self.layout(), self.channels, device)
    }
}
