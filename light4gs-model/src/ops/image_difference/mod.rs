//! The mean difference of an image and the truth, as a Burn operation: one pass over the pixels in each direction, where a
//! composition takes several.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};

#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
use super::host::HostBackend;
use super::{differentiate, for_all_back_ends, for_cpu_back_ends};
use crate::cpu::image_difference::{gradient, mean};
pub use crate::kernels::image_difference::{Difference, ImageDifferenceKernels};

/// The mean on every back end that has [`ImageDifferenceKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait ImageDifferenceOps: Backend {
    /// `[1]`; see [`mean_difference`].
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
        #[derive(Debug)]
        struct ImageDifference;

        impl<B: ImageDifferenceKernels> Backward<B, 1> for ImageDifference {
            type State = (Difference, FloatTensor<B>, FloatTensor<B>);

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |(difference, image, truth), upstream| {
                    [B::image_difference_backward(difference, image, truth, upstream)]
                });
            }
        }

        let node = image.node();
        let (image, truth) = (image.into_primitive(), truth.into_primitive());
        let mean = B::image_difference_forward(difference, image.clone(), truth.clone());
        match ImageDifference.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((difference, image, truth), mean),
            OpsKind::UnTracked(prep) => prep.finish(mean),
        }
    }
}

fn forward_on_cpu<B: HostBackend>(
    difference: Difference,
    image: FloatTensor<B>,
    truth: FloatTensor<B>,
) -> FloatTensor<B> {
    let (image, truth) = (B::to_host(image), B::to_host(truth));
    B::from_values(vec![mean(difference, image.as_slice(), truth.as_slice())], [1])
}

fn backward_on_cpu<B: HostBackend>(
    difference: Difference,
    image: FloatTensor<B>,
    truth: FloatTensor<B>,
    upstream: FloatTensor<B>,
) -> FloatTensor<B> {
    let shape = image.shape();
    let [image, truth, upstream] = [image, truth, upstream].map(B::to_host);
    B::from_values(gradient(difference, image.as_slice(), truth.as_slice(), upstream.as_slice()[0]), shape)
}

for_cpu_back_ends! {
    ImageDifferenceKernels {
        fn image_difference_forward(
            difference: Difference,
            image: FloatTensor<Self>,
            truth: FloatTensor<Self>,
        ) -> FloatTensor<Self> {
            forward_on_cpu::<Self>(difference, image, truth)
        }

        fn image_difference_backward(
            difference: Difference,
            image: FloatTensor<Self>,
            truth: FloatTensor<Self>,
            upstream: FloatTensor<Self>,
        ) -> FloatTensor<Self> {
            backward_on_cpu::<Self>(difference, image, truth, upstream)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + ImageDifferenceKernels> ImageDifferenceKernels for Fusion<B> {
    fn image_difference_forward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        leaf::<B>(B::image_difference_forward(difference, resolve::<B>(image), resolve::<B>(truth)))
    }

    fn image_difference_backward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [image, truth, upstream] = [image, truth, upstream].map(resolve::<B>);
        leaf::<B>(B::image_difference_backward(difference, image, truth, upstream))
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
    assert_eq!(image.dims(), truth.dims(), "both images must have the same size");
    Tensor::from_dispatch(Dispatch::image_difference(difference, image.into_dispatch(), truth.into_dispatch()))
}
