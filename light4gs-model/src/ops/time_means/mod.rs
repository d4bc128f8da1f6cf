//! Means of two space-time planes over time, spread over the plane of their space axes, as a Burn operation.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// The planes, or their gradients, in the order in which gradients are registered.
#[derive(Clone, Debug, ExtensionType)]
pub struct PlanesOverTime<B: Backend> {
    /// `[M, T, A]`: over the axis along the columns of the result, and time.
    pub over_a: FloatTensor<B>,
    /// `[M, T, B]`: over the axis along the rows of the result, and time.
    pub over_b: FloatTensor<B>,
}

/// Sizes of the planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeSizes {
    channels: usize,
    /// T of each plane.
    times: [usize; 2],
    /// A and B.
    lengths: [usize; 2],
}

impl TimeSizes {
    fn of<B: Backend>(planes: &PlanesOverTime<B>) -> Self {
        let [a, b] = [&planes.over_a, &planes.over_b].map(|plane| plane.shape());
        Self { channels: a[0], times: [a[1], b[1]], lengths: [a[2], b[2]] }
    }

    /// What a time counts in the mean of a plane.
    fn share(&self, plane: usize) -> f32 {
        1.0 / self.times[plane] as f32
    }

    /// Of the result, `[2 M, B, A]`.
    fn output(&self) -> [usize; 3] {
        [2 * self.channels, self.lengths[1], self.lengths[0]]
    }

    /// Of one of the planes.
    fn input(&self, plane: usize) -> [usize; 3] {
        [self.channels, self.times[plane], self.lengths[plane]]
    }
}

/// A back end's kernels. [`TimeMeansOps`] adds the dispatch and the tape.
pub trait TimeMeansKernels: Backend {
    /// The means, `[2 M, B, A]`.
    fn time_means_forward(planes: PlanesOverTime<Self>) -> FloatTensor<Self>;

    /// Gradients of the planes from that of the means.
    fn time_means_backward(sizes: TimeSizes, gradient: FloatTensor<Self>) -> PlanesOverTime<Self>;
}

/// The means on every back end that has [`TimeMeansKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait TimeMeansOps: Backend {
    /// See [`time_means`].
    fn time_means(#[extension_type] planes: PlanesOverTime<Self>) -> FloatTensor<Self>;
}

for_all_back_ends! {
    TimeMeansOps with TimeMeansKernels {
        fn time_means(planes: PlanesOverTime<Self>) -> FloatTensor<Self> {
            Self::time_means_forward(planes)
        }
    }
}

impl<B: TimeMeansOps + TimeMeansKernels, C: CheckpointStrategy> TimeMeansOps for Autodiff<B, C> {
    fn time_means(planes: PlanesOverTime<Self>) -> FloatTensor<Self> {
        let nodes = [planes.over_a.node(), planes.over_b.node()];
        let [over_a, over_b] = [planes.over_a, planes.over_b].map(|plane| plane.into_primitive());
        let planes = PlanesOverTime { over_a, over_b };
        let sizes = TimeSizes::of::<B>(&planes);
        recorded::<B, C, _, _>(nodes, (B::time_means_forward(planes), sizes), |sizes, gradient| {
            let gradients = B::time_means_backward(sizes, gradient);
            [gradients.over_a, gradients.over_b]
        })
    }
}

/// `[2 M, B, A]` from `over_a [M, T, A]` and `over_b [M, T, B]`: the mean of `over_a` over time in every row of the first M channels, and
/// that of `over_b` in every column of the others.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::time_means::time_means;
///
/// let device = Device::flex();
/// let over_a = Tensor::<3>::from_floats([[[1.0, 2.0], [3.0, 6.0]]], &device);
/// let over_b = Tensor::<3>::from_floats([[[5.0], [7.0]]], &device);
/// let means = time_means(over_a, over_b);
/// assert_eq!(means.dims(), [2, 1, 2]);
/// assert_eq!(means.into_data().to_vec::<f32>().unwrap(), [2.0, 4.0, 6.0, 6.0]);
/// ```
///
/// # Panics
/// If the planes differ in channels, or one has no times.
pub fn time_means(over_a: Tensor<3>, over_b: Tensor<3>) -> Tensor<3> {
    let ([channels, a_times, _], [others, b_times, _]) = (over_a.dims(), over_b.dims());
    assert_eq!(channels, others, "planes with the same channels");
    assert!(a_times > 0 && b_times > 0, "planes with times");
    let planes = PlanesOverTime { over_a: over_a.into_dispatch(), over_b: over_b.into_dispatch() };
    Tensor::from_dispatch(Dispatch::time_means(planes))
}
