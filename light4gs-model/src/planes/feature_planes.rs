//! Learned feature planes.

use burn::module::{Module, Param};
use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::plane_layout::PlaneLayout;

use super::PlaneTensors;

/// Trained planes. A query multiplies the bilinear samples of a scale's planes and concatenates the scales.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
/// use light4gs_model::FeaturePlanes;
///
/// let device = Device::flex();
/// let triplane = PlaneLayout::multiscale(&PlaneAxes::SPACE_ONLY, [8, 8, 8, 4], &[1, 2]);
/// let planes = FeaturePlanes::init(&triplane, 4, &device);
/// let points = Tensor::<2>::zeros([10, 4], &device);
/// assert_eq!(planes.query(points).dims(), [10, 4 * 2]);
/// ```
#[derive(Module, Debug)]
pub struct FeaturePlanes {
    /// `[C, H, W]`, in the layout's order.
    pub planes: Vec<Param<Tensor<3>>>,
    #[module(skip)]
    layout: PlaneLayout,
}

impl FeaturePlanes {
    /// Planes at their start: those with time at 1 ("no motion"), those over space uniform in [0.1, 0.5].
    pub fn init(layout: &PlaneLayout, channels: usize, device: &Device) -> Self {
        let planes = layout.planes().iter().map(|plane| {
            let [height, width] = plane.size;
            let shape = [channels, height, width];
            Param::from_tensor(if plane.axes.is_space_time() {
                Tensor::ones(shape, device)
            } else {
                Tensor::random(shape, Distribution::Uniform(0.1, 0.5), device)
            })
        });
        Self { planes: planes.collect(), layout: layout.clone() }
    }

    /// From planes `[C, H, W]`.
    ///
    /// # Panics
    /// As [`PlaneTensors::new`], or if there are no planes.
    pub fn from_tensors(planes: PlaneTensors) -> Self {
        assert!(!planes.is_empty(), "feature planes need a plane");
        let layout = planes.layout().clone();
        Self { planes: planes.into_tensors().into_iter().map(Param::from_tensor).collect(), layout }
    }

    /// Which planes there are.
    pub fn layout(&self) -> &PlaneLayout {
        &self.layout
    }

    /// Channels of each plane.
    pub fn channels(&self) -> usize {
        self.planes.first().map_or(0, |plane| plane.dims()[0])
    }

    /// Length of a feature: channels times scales.
    pub fn feature_size(&self) -> usize {
        self.channels() * self.layout.scales()
    }

    /// The planes' values.
    pub fn tensors(&self) -> PlaneTensors {
        PlaneTensors::new(self.layout.clone(), self.planes.iter().map(Param::val).collect())
    }

    /// Features `[N, C · scales]` at points `[N, 4]`: x, y, z, t in [-1, 1] (clamped to the border outside).
    pub fn query(&self, points: Tensor<2>) -> Tensor<2> {
        self.tensors().query(points)
    }
}
