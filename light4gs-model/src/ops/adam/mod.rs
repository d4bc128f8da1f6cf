//! One fused Adam step for each tensor (Kingma and Ba, 2015), in place where the tensor is not shared.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

/// Numbers of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamStep {
    /// Learning rate of this step.
    pub learning_rate: f32,
    /// Decay of the first moment.
    pub beta_1: f64,
    /// Decay of the second moment.
    pub beta_2: f64,
    /// Added to the root of the second moment after bias correction.
    pub epsilon: f32,
    /// Steps that this parameter has taken, this one included (so at least 1).
    pub time: u32,
}

impl AdamStep {
    /// Learning rate over the first moment's bias correction.
    pub(crate) fn corrected_learning_rate(&self) -> f32 {
        (f64::from(self.learning_rate) / (1.0 - self.beta_1.powi(self.time as i32))) as f32
    }

    /// Root of the second moment's bias correction.
    pub(crate) fn root_correction(&self) -> f32 {
        (1.0 - self.beta_2.powi(self.time as i32)).sqrt() as f32
    }
}

/// A parameter with its moments.
#[derive(ExtensionType)]
pub struct AdamTensors<B: Backend> {
    /// The parameter, any shape.
    pub parameter: FloatTensor<B>,
    /// First moment, in the parameter's shape.
    pub first_moment: FloatTensor<B>,
    /// Second moment, in the parameter's shape.
    pub second_moment: FloatTensor<B>,
}

/// The fused step on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait AdamOps: Backend {
    /// Parameter and moments after one step along `gradient`.
    fn adam(
        #[extension_type] tensors: AdamTensors<Self>,
        gradient: FloatTensor<Self>,
        step: AdamStep,
    ) -> AdamTensors<Self>;
}

/// Takes one Adam step on tensors without autodiff; returns parameter, first and second moment.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::adam::{AdamStep, adam_step};
///
/// let device = Device::flex();
/// let step = AdamStep { learning_rate: 0.1, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time: 1 };
/// let zeros = Tensor::<1>::zeros([2], &device);
/// let gradient = Tensor::from_floats([3.0, -4.0], &device);
/// let [parameter, _, _] = adam_step([zeros.clone(), zeros.clone(), zeros], gradient, step);
/// // The first step has the size of the learning rate, against the gradient's sign.
/// let values = parameter.into_data().to_vec::<f32>().unwrap();
/// assert!((values[0] + 0.1).abs() < 1e-6 && (values[1] - 0.1).abs() < 1e-6);
/// ```
pub fn adam_step<const D: usize>(
    [parameter, first, second]: [Tensor<D>; 3],
    gradient: Tensor<D>,
    step: AdamStep,
) -> [Tensor<D>; 3] {
    let tensors = AdamTensors {
        parameter: parameter.into_dispatch(),
        first_moment: first.into_dispatch(),
        second_moment: second.into_dispatch(),
    };
    let out = Dispatch::adam(tensors, gradient.into_dispatch(), step);
    [out.parameter, out.first_moment, out.second_moment].map(Tensor::from_dispatch)
}
