//! The multiscale hexplane (HexPlane, Cao and Johnson 2023; multiscale as in K-Planes and 4DGS): a plane over each pair of
//! axes at every scale.

use burn::config::Config;
use burn::tensor::Device;
use light4gs_codec::plane_layout::{AXIS_NAMES, IllegalSize, PlaneAxes, PlaneLayout, check_resolution};

use super::FeaturePlanes;

/// Configuration of [`FeaturePlanes`] that are a hexplane.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::HexPlaneConfig;
///
/// let device = Device::flex();
/// let hexplane = HexPlaneConfig::new().with_channels(4).with_resolution([8, 8, 8, 4]).init(&device);
/// let points = Tensor::<2>::zeros([10, 4], &device);
/// assert_eq!(hexplane.query(points).dims(), [10, 4 * 2]);
/// ```
#[derive(Config, Debug)]
pub struct HexPlaneConfig {
    /// Channels of each plane (`h` in the paper).
    #[config(default = 32)]
    pub channels: usize,
    /// Cells along x, y, z and t at the lowest scale, each a multiple of 4.
    #[config(default = "[64, 64, 64, 24]")]
    pub resolution: [usize; 4],
    /// One for each scale: spatial resolutions are multiplied by it, time keeps its own.
    #[config(default = "vec![1, 2]")]
    pub multipliers: Vec<usize>,
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
    /// # Panics
    /// If [`Self::check`] refuses the resolution.
    pub fn init(&self, device: &Device) -> FeaturePlanes {
        if let Err(problem) = self.check() {
            panic!("the planes' resolution is {problem}");
        }
        FeaturePlanes::init(&self.layout(), self.channels, device)
    }
}
