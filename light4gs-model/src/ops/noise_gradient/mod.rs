//! The gradient of the logarithms of noise's widths, as a Burn operation: one launch and a short one for all tensors, where Burn
//! takes five for each. Not differentiable.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::tensor_list::TensorList;

/// A value of a tensor with noise, that without, and the gradient of the noisy one.
#[derive(Clone, Debug)]
pub struct NoisyValues {
    /// With noise, `[n]`.
    pub noisy: Tensor<1>,
    /// Without, `[n]`.
    pub exact: Tensor<1>,
    /// `[n]`.
    pub gradient: Tensor<1>,
}

/// Lists of [`NoisyValues`]; at least one.
#[derive(ExtensionType)]
pub struct NoisyTensors<B: Backend> {
    /// With noise.
    #[extension_type]
    pub noisy: TensorList<B>,
    /// Without.
    #[extension_type]
    pub exact: TensorList<B>,
    /// Gradients of the noisy ones.
    #[extension_type]
    pub gradients: TensorList<B>,
}

/// The gradient on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait NoiseGradientOps: Backend {
    /// `[count]`; see [`noise_gradient`]. Tensor `k` has the place `places[k]`; places ascend.
    fn noise_gradient(
        #[extension_type] tensors: NoisyTensors<Self>,
        places: Vec<usize>,
        count: usize,
    ) -> FloatTensor<Self>;
}

/// `Σ (noisy - exact) · gradient` for each tensor, in a list as long as that of tensors, and 0 where there is none: the gradient of
/// the logarithm of the width of its noise, since the noise is proportional to the width. `None` if there are none at all.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::noise_gradient::{NoisyValues, noise_gradient};
///
/// let device = Device::flex();
/// let numbers = |a: f32, b: f32| Tensor::<1>::from_floats([a, b], &device);
/// let values = NoisyValues { noisy: numbers(1.5, 2.0), exact: numbers(1.0, 3.0), gradient: numbers(4.0, 5.0) };
/// let found = noise_gradient(vec![None, Some(values)]).unwrap();
/// assert_eq!(found.into_data().to_vec::<f32>().unwrap(), [0.0, -3.0]);
/// ```
///
/// # Panics
/// If the three tensors of one differ in length.
pub fn noise_gradient(tensors: Vec<Option<NoisyValues>>) -> Option<Tensor<1>> {
    let count = tensors.len();
    let (mut noisy, mut exact, mut gradients) = (Vec::new(), Vec::new(), Vec::new());
    let mut places = Vec::new();
    for (place, values) in tensors.into_iter().enumerate() {
        let Some(values) = values else { continue };
        let lengths = [&values.noisy, &values.exact, &values.gradient].map(|tensor| tensor.dims()[0]);
        assert!(lengths.iter().all(|length| *length == lengths[0]), "one length, not {lengths:?}");
        // Kernels refuse empty tensors.
        if lengths[0] > 0 {
            places.push(place);
            noisy.push(values.noisy.into_dispatch());
            exact.push(values.exact.into_dispatch());
            gradients.push(values.gradient.into_dispatch());
        }
    }
    (!places.is_empty()).then(|| {
        let tensors =
            NoisyTensors { noisy: TensorList(noisy), exact: TensorList(exact), gradients: TensorList(gradients) };
        Tensor::from_dispatch(Dispatch::noise_gradient(tensors, places, count))
    })
}
