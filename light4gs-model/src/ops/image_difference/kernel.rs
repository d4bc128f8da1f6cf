//! How much two images differ in the mean.

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;

/// What the mean is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// Absolute differences (L1).
    Absolute,
    /// Squared differences (L2).
    Squared,
}

impl Difference {
    /// Of two numbers that differ by this.
    pub(crate) fn of(self, difference: f32) -> f32 {
        match self {
            Self::Absolute => difference.abs(),
            Self::Squared => difference * difference,
        }
    }

    /// Its slope there; 0 where two numbers are the same.
    pub(crate) fn slope(self, difference: f32) -> f32 {
        match self {
            Self::Absolute if difference == 0.0 => 0.0,
            // NaN keeps its sign bit and stays NaN.
            Self::Absolute if difference.is_nan() => difference,
            Self::Absolute => difference.signum(),
            Self::Squared => 2.0 * difference,
        }
    }
}

/// A back end's kernels. [`ImageDifferenceOps`](crate::ops::image_difference::ImageDifferenceOps) adds the dispatch and the tape.
pub trait ImageDifferenceKernels: Backend {
    /// The mean `[1]` over all numbers of two images of the same shape.
    fn image_difference_forward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// The gradient of the image from that of the mean `[1]`.
    fn image_difference_backward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}
