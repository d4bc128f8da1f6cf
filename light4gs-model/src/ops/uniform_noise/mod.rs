//! Uniform noise in place of rounding, from a seed: the same numbers on every back end and for any number of threads. Not
//! differentiable.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// The noise on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait UniformNoiseOps: Backend {
    /// Values of any shape with noise of one of the widths `[W]`; see [`add_uniform_noise`].
    fn uniform_noise(
        values: FloatTensor<Self>,
        widths: FloatTensor<Self>,
        which: usize,
        seed: [u32; 2],
    ) -> FloatTensor<Self>;
}

/// Values with independent noise, uniform in an interval around 0 whose width is one of the widths `[W]`, the one at `which`.
/// On a GPU, a slice of the widths would be one more launch for each tensor.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::uniform_noise::add_uniform_noise;
///
/// let device = Device::flex();
/// let widths = Tensor::from_floats([0.1, 0.5], &device);
/// let noisy = add_uniform_noise(Tensor::<1>::ones([100], &device), widths, 1, 7);
/// assert!(noisy.into_data().iter::<f32>().all(|value| (0.75..=1.25).contains(&value)));
/// ```
///
/// # Panics
/// If a tensor is on an autodiff device, or there is no width at `which`.
pub fn add_uniform_noise<const D: usize>(values: Tensor<D>, widths: Tensor<1>, which: usize, seed: u64) -> Tensor<D> {
    assert!(which < widths.dims()[0], "no width at {which} of {}", widths.dims()[0]);
    assert!(!values.device().is_autodiff(), "noise has no derivative: give it inner tensors");
    let seed = [seed as u32, (seed >> 32) as u32];
    Tensor::from_dispatch(Dispatch::uniform_noise(values.into_dispatch(), widths.into_dispatch(), which, seed))
}
