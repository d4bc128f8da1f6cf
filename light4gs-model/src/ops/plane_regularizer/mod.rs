//! The regularizer of feature planes as a Burn operation: smoothness, and distance from 1, of all planes of a scale at once.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;
use light4gs_codec::plane_layout::PlaneAxes;

use super::{for_all_back_ends, recorded};

/// Planes that a scale may have.
const PLANES: usize = PlaneAxes::ALL.len();
/// A second difference takes as many rows.
const LEAST_ROWS: usize = 3;

/// The planes of one scale, each `[C, H, W]` in its own size. A plane without weights may be anything.
#[derive(ExtensionType)]
pub struct RegularizedPlanes<B: Backend> {
    /// Over x and y.
    pub xy: FloatTensor<B>,
    /// Over x and z.
    pub xz: FloatTensor<B>,
    /// Over x and time.
    pub xt: FloatTensor<B>,
    /// Over y and z.
    pub yz: FloatTensor<B>,
    /// Over y and time.
    pub yt: FloatTensor<B>,
    /// Over z and time.
    pub zt: FloatTensor<B>,
}

impl<B: Backend> RegularizedPlanes<B> {
    fn into_array(self) -> [FloatTensor<B>; PLANES] {
        [self.xy, self.xz, self.xt, self.yz, self.yt, self.zt]
    }

    fn from_array([xy, xz, xt, yz, yt, zt]: [FloatTensor<B>; PLANES]) -> Self {
        Self { xy, xz, xt, yz, yt, zt }
    }
}

/// Weights of the terms of one plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneWeights {
    /// Of the mean squared second difference along the height.
    pub smoothness: f32,
    /// Of the mean distance from 1.
    pub distance: f32,
}

impl PlaneWeights {
    /// The weights of one squared second difference and of one distance in a plane `[C, H, W]`.
    fn of_numbers(self, [channels, height, width]: [usize; 3]) -> [f32; 2] {
        let differences = channels * (height + 1).saturating_sub(LEAST_ROWS) * width;
        let smoothness = if differences > 0 { self.smoothness / differences as f32 } else { 0.0 };
        [smoothness, self.distance / (channels * height * width) as f32]
    }
}

/// A back end's kernels. [`PlaneRegularizerOps`] adds the dispatch and the tape.
pub trait PlaneRegularizerKernels: Backend {
    /// Gradients for a loss that counts once.
    type Derivatives: Clone + Debug + Send + 'static;

    /// The loss `[1]`. Its gradients are worked out along with it: they need what it needs.
    fn plane_regularizer_forward(
        planes: RegularizedPlanes<Self>,
        weights: [PlaneWeights; PLANES],
    ) -> (FloatTensor<Self>, Self::Derivatives);

    /// Gradients of the planes from that of the loss `[1]`.
    fn plane_regularizer_backward(
        derivatives: Self::Derivatives,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; PLANES];
}

/// The loss on every back end that has [`PlaneRegularizerKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait PlaneRegularizerOps: Backend {
    /// The loss `[1]`; see [`regularize`].
    fn plane_regularizer(
        #[extension_type] planes: RegularizedPlanes<Self>,
        weights: [PlaneWeights; PLANES],
    ) -> FloatTensor<Self>;
}

for_all_back_ends! {
    PlaneRegularizerOps with PlaneRegularizerKernels {
        fn plane_regularizer(planes: RegularizedPlanes<Self>, weights: [PlaneWeights; PLANES]) -> FloatTensor<Self> {
            Self::plane_regularizer_forward(planes, weights).0
        }
    }
}

impl<B: PlaneRegularizerOps + PlaneRegularizerKernels, C: CheckpointStrategy> PlaneRegularizerOps for Autodiff<B, C> {
    fn plane_regularizer(planes: RegularizedPlanes<Self>, weights: [PlaneWeights; PLANES]) -> FloatTensor<Self> {
        let planes = planes.into_array();
        let parents = planes.each_ref().map(|plane| plane.node());
        let inner = RegularizedPlanes::from_array(planes.map(|plane| plane.into_primitive()));
        let forward = B::plane_regularizer_forward(inner, weights);
        recorded::<B, C, _, _>(parents, forward, B::plane_regularizer_backward)
    }
}

/// The loss `[1]` of planes `[C, H, W]` in the order of [`PlaneAxes::ALL`] (4DGS: `compute_regulation`):
///
/// ```text
/// Σ over planes of  smoothness · mean (v[y - 1] - 2 v[y] + v[y + 1])²  +  distance · mean |v - 1|
/// ```
///
/// Planes with fewer than three rows have no second difference. Where a value is 1, the distance has the slope 0.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::plane_regularizer::{PlaneWeights, regularize};
///
/// let device = Device::flex();
/// let planes = std::array::from_fn(|_| Tensor::<3>::from_floats([[[1.0], [1.0], [3.0]]], &device));
/// let loss = regularize(planes, [PlaneWeights { smoothness: 0.25, distance: 0.0 }; 6]);
/// assert_eq!(loss.into_scalar::<f32>(), 6.0);
/// ```
///
/// [`PlaneAxes::ALL`]: light4gs_codec::plane_layout::PlaneAxes::ALL
pub fn regularize(planes: [Tensor<3>; PLANES], weights: [PlaneWeights; PLANES]) -> Tensor<1> {
    let [xy, xz, xt, yz, yt, zt] = planes.map(Tensor::into_dispatch);
    let planes = RegularizedPlanes { xy, xz, xt, yz, yt, zt };
    Tensor::from_dispatch(Dispatch::plane_regularizer(planes, weights))
}
