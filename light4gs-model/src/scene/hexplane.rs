//! The multiscale hexplane (HexPlane, Cao and Johnson 2023; multiscale as in K-Planes and 4DGS).

use burn::backend::Dispatch;
use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::plane_layout::{
    IllegalSize, PLANE_AXES, PLANES_PER_SCALE, SPACE_TIME_PLANES, TIME_AXIS, check_resolution,
};

use crate::ops::hexplane_query::{HexPlaneOps, QueryInputs};

/// Configuration of a [`HexPlane`].
#[derive(Config, Debug)]
pub struct HexPlaneConfig {
    /// Channels of each plane (`h` in the paper).
    #[config(default = 32)]
    pub channels: usize,
    /// Cells along x, y, z and t at the lowest scale, each a multiple of 4.
    #[config(default = "[64, 64, 64, 24]")]
    pub resolution: [usize; 4],
    /// One scale each: spatial resolutions are multiplied, time keeps its own.
    #[config(default = "vec![1, 2]")]
    pub multipliers: Vec<usize>,
}

impl HexPlaneConfig {
    /// Cells along x, y, z, t at a scale.
    pub fn resolution_at(&self, scale: usize) -> [usize; 4] {
        std::array::from_fn(|axis| self.resolution[axis] * if axis == TIME_AXIS { 1 } else { self.multipliers[scale] })
    }

    /// `[C, H, W]` of a plane.
    pub fn plane_shape(&self, scale: usize, plane: usize) -> [usize; 3] {
        let resolution = self.resolution_at(scale);
        let [across, down] = PLANE_AXES[plane];
        [self.channels, resolution[down], resolution[across]]
    }

    /// Whether there can be planes of this resolution: what the codec and the context model refuse is refused here.
    ///
    /// # Errors
    /// The axis, and the nearest legal size.
    pub fn check(&self) -> Result<(), IllegalSize> {
        check_resolution(self.resolution)
    }

    /// Space-time planes start at 1, space-only planes uniform in [0.1, 0.5].
    ///
    /// # Panics
    /// If [`Self::check`] refuses the resolution.
    pub fn init(&self, device: &Device) -> HexPlane {
        if let Err(problem) = self.check() {
            panic!("the planes' resolution is {problem}");
        }
        let planes = (0..self.multipliers.len())
            .flat_map(|scale| (0..PLANES_PER_SCALE).map(move |plane| (scale, plane)))
            .map(|(scale, plane)| {
                let shape = self.plane_shape(scale, plane);
                Param::from_tensor(if SPACE_TIME_PLANES.contains(&plane) {
                    Tensor::ones(shape, device)
                } else {
                    Tensor::random(shape, Distribution::Uniform(0.1, 0.5), device)
                })
            })
            .collect();
        HexPlane { planes, channels: self.channels }
    }
}

/// Learned planes. A query multiplies the six bilinear samples of a scale and puts the scales side by side.
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
#[derive(Module, Debug)]
pub struct HexPlane {
    /// Scale-major, six a scale in the order of [`PLANE_NAMES`](light4gs_codec::plane_layout::PLANE_NAMES).
    pub planes: Vec<Param<Tensor<3>>>,
    channels: usize,
}

impl HexPlane {
    /// From planes `[C, res b, res a]`, scale-major.
    ///
    /// # Panics
    /// If there are no planes, or their number is no multiple of six.
    pub fn from_planes(planes: Vec<Tensor<3>>) -> Self {
        assert!(
            !planes.is_empty() && planes.len().is_multiple_of(PLANES_PER_SCALE),
            "a hexplane has six planes a scale, not {}",
            planes.len()
        );
        let channels = planes[0].dims()[0];
        Self { planes: planes.into_iter().map(Param::from_tensor).collect(), channels }
    }

    /// Number of scales.
    pub fn scales(&self) -> usize {
        self.planes.len() / PLANES_PER_SCALE
    }

    /// Length of a feature: channels times scales.
    pub fn feature_size(&self) -> usize {
        self.channels * self.scales()
    }

    /// The planes `[C, res b, res a]`, scale-major.
    pub fn tensors(&self) -> Vec<Tensor<3>> {
        self.planes.iter().map(Param::val).collect()
    }

    /// Features `[N, C · scales]` at points `[N, 4]`: x, y, z, t in [-1, 1] (clamped to the border outside).
    pub fn query(&self, points: Tensor<2>) -> Tensor<2> {
        query_planes(points, self.tensors())
    }
}

/// [`HexPlane::query`] with other tensors in place of the planes: decoded ones, say, or planes that carry noise.
/// Differentiable in points and planes.
///
/// # Panics
/// If the points are not `[N, 4]`, or the number of planes is no multiple of six.
pub fn query_planes(points: Tensor<2>, planes: Vec<Tensor<3>>) -> Tensor<2> {
    assert_eq!(points.dims()[1], 4, "points must be [N, 4]: x, y, z, t");
    assert!(planes.len().is_multiple_of(PLANES_PER_SCALE), "six planes a scale, not {}", planes.len());
    let mut features: Vec<Tensor<2>> = planes
        .chunks_exact(PLANES_PER_SCALE)
        .map(|scale| {
            let [xy, xz, xt, yz, yt, zt] = std::array::from_fn(|k| scale[k].clone().into_dispatch());
            let inputs = QueryInputs { points: points.clone().into_dispatch(), xy, xz, xt, yz, yt, zt };
            Tensor::from_dispatch(Dispatch::hexplane_query(inputs))
        })
        .collect();
    if features.len() == 1 { features.remove(0) } else { Tensor::cat(features, 1) }
}
