//! The mean difference of an image and the truth, as a Burn operation: one pass over the pixels in each direction, where a
//! composition takes several.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// A kind of difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// Absolute differences (L1).
    Absolute,
    /// Squared differences (L2).
    Squared,
}

impl Difference {
    /// The difference as it is counted, from the signed one.
    fn of(self, difference: f32) -> f32 {
        match self {
            Self::Absolute => difference.abs(),
            Self::Squared => difference * difference,
        }
    }

    /// Its slope there; 0 where two numbers are the same.
    fn slope(self, difference: f32) -> f32 {
        match self {
            Self::Absolute if difference == 0.0 => 0.0,
            // NaN keeps its sign bit and stays NaN.
            Self::Absolute if difference.is_nan() => difference,
            Self::Absolute => difference.signum(),
            Self::Squared => 2.0 * difference,
        }
    }
}

/// A back end's kernels. [`ImageDifferenceOps`] adds the dispatch and the tape.
pub trait ImageDifferenceKernels: Backend {
    /// The mean over all numbers of two images of the same shape, in parts that are to be added up, `[P]`.
    fn image_difference_forward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// The gradient of the image from those of the parts `[P]`.
    fn image_difference_backward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

/// The mean on every back end that has [`ImageDifferenceKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait ImageDifferenceOps: Backend {
    /// `[P]`; see [`mean_difference_in_parts`].
    fn image_difference(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

for_all_back_ends! {
    ImageDifferenceOps with ImageDifferenceKernels {
        fn image_difference(
            difference: Difference,
            image: FloatTensor<Self>,
            truth: FloatTensor<Self>,
        ) -> FloatTensor<Self> {
            Self::image_difference_forward(difference, image, truth)
        }
    }
}

impl<B: ImageDifferenceOps + ImageDifferenceKernels, C: CheckpointStrategy> ImageDifferenceOps for Autodiff<B, C> {
    fn image_difference(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let node = image.node();
        let (image, truth) = (image.into_primitive(), truth.into_primitive());
        let parts = B::image_difference_forward(difference, image.clone(), truth.clone());
        recorded::<B, C, _, _>([node], (parts, (difference, image, truth)), |(difference, image, truth), upstream| {
            [B::image_difference_backward(difference, image, truth, upstream)]
        })
    }
}

/// The mean difference of an image and the truth, of one shape and not empty, over all their numbers: `[1]`. Differentiable in the
/// image; the truth is a constant.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::image_difference::{Difference, mean_difference};
///
/// let device = Device::flex().autodiff();
/// let image = Tensor::<2>::from_floats([[0.5, 0.0], [1.0, 0.25]], &device).require_grad();
/// let mean = mean_difference(Difference::Absolute, image.clone(), Tensor::zeros([2, 2], &device));
/// assert_eq!(mean.clone().into_scalar::<f32>(), 0.4375);
/// let gradient = image.grad(&mean.backward()).unwrap();
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [0.25, 0.0, 0.25, 0.25]);
/// ```
///
/// # Panics
/// If the shapes differ.
pub fn mean_difference<const D: usize>(difference: Difference, image: Tensor<D>, truth: Tensor<D>) -> Tensor<1> {
    let parts = mean_difference_in_parts(difference, image, truth);
    if parts.dims() == [1] { parts } else { parts.sum() }
}

/// [`mean_difference`] in parts that are to be added up, `[P]`. A backward pass from several numbers is that of their sum, so a
/// loss needs no launch for the sum.
///
/// # Panics
/// If the shapes differ.
pub fn mean_difference_in_parts<const D: usize>(
    difference: Difference,
    image: Tensor<D>,
    truth: Tensor<D>,
) -> Tensor<1> {
    assert_eq!(image.dims(), truth.dims(), "both images must have the same size");
    Tensor::from_dispatch(Dispatch::image_difference(difference, image.into_dispatch(), truth.into_dispatch()))
}
