//! Uniform noise in place of rounding, from seeds: the same numbers on every back end and for any number of threads. Not
//! differentiable.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

use super::tensor_list::TensorList;

/// The noise of one tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoiseDraw {
    /// Its width, by its place among the widths.
    pub width: usize,
    /// Whether that width is to be multiplied by the unit.
    pub in_units: bool,
    /// The same seed gives the same noise.
    pub seed: u64,
}

/// The noise on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait UniformNoiseOps: Backend {
    /// Values of any shapes with noise of some of the widths `[W]`; see [`add_uniform_noise`].
    fn uniform_noise(
        #[extension_type] values: TensorList<Self>,
        widths: FloatTensor<Self>,
        unit: FloatTensor<Self>,
        draws: Vec<NoiseDraw>,
    ) -> TensorList<Self>;
}

/// Values with independent noise, uniform in an interval around 0 whose width is one of the widths `[W]`, some of which count in
/// a unit `[1]`. There is a draw for each tensor. On a GPU all tensors take one launch.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::uniform_noise::{NoiseDraw, add_uniform_noise};
///
/// let device = Device::flex();
/// let (widths, unit) = (Tensor::from_floats([0.1, 0.25], &device), Tensor::from_floats([2.0], &device));
/// let draw = NoiseDraw { width: 1, in_units: true, seed: 7 };
/// let noisy = add_uniform_noise(vec![Tensor::<1>::ones([100], &device)], widths, unit, vec![draw]);
/// assert!(noisy[0].clone().into_data().iter::<f32>().all(|value| (0.75..=1.25).contains(&value)));
/// ```
///
/// # Panics
/// If a tensor is on an autodiff device; if there is no draw for each tensor, or no width of a draw.
pub fn add_uniform_noise(
    values: Vec<Tensor<1>>,
    widths: Tensor<1>,
    unit: Tensor<1>,
    draws: Vec<NoiseDraw>,
) -> Vec<Tensor<1>> {
    let count = widths.dims()[0];
    assert_eq!(values.len(), draws.len(), "a draw for each tensor");
    assert!(draws.iter().all(|draw| draw.width < count), "no such width among {count}: {draws:?}");
    assert!(!widths.device().is_autodiff(), "noise has no derivative: give it inner tensors");
    if values.is_empty() {
        return values;
    }
    let values = TensorList(values.into_iter().map(Tensor::into_dispatch).collect());
    let noisy = Dispatch::uniform_noise(values, widths.into_dispatch(), unit.into_dispatch(), draws);
    noisy.0.into_iter().map(Tensor::from_dispatch).collect()
}
