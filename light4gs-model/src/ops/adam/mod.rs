//! One fused Adam step of any number of tensors (Kingma and Ba, 2015). On a CPU it is made in place where a tensor is not shared, on
//! a GPU all tensors are stepped at once.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::{Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::tensor_list::TensorList;

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

/// Parameters with their moments, each flattened and not empty.
#[derive(ExtensionType)]
pub struct AdamTensors<B: Backend> {
    /// The parameters, `[n]` each.
    #[extension_type]
    pub parameters: TensorList<B>,
    /// First moments, in the parameters' shapes.
    #[extension_type]
    pub first_moments: TensorList<B>,
    /// Second moments, in the parameters' shapes.
    #[extension_type]
    pub second_moments: TensorList<B>,
}

/// The fused step on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait AdamOps: Backend {
    /// Parameters and moments after one step along their gradients.
    fn adam(
        #[extension_type] tensors: AdamTensors<Self>,
        #[extension_type] gradients: TensorList<Self>,
        steps: Vec<AdamStep>,
    ) -> AdamTensors<Self>;
}

/// A parameter on its way through a step. All tensors are without autodiff and have one shape.
#[derive(Clone, Debug)]
pub struct SteppedParameter {
    /// The parameter.
    pub value: Tensor<1>,
    /// First and second moment.
    pub moments: [Tensor<1>; 2],
    /// The gradient.
    pub gradient: Tensor<1>,
    /// The step's numbers.
    pub step: AdamStep,
}

/// Takes one Adam step of each parameter; returns values and moments in the same order. Parameters must not be empty.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::adam::{AdamStep, SteppedParameter, adam_steps};
///
/// let device = Device::flex();
/// let zeros = Tensor::<1>::zeros([2], &device);
/// let parameter = SteppedParameter {
///     value: zeros.clone(),
///     moments: [zeros.clone(), zeros],
///     gradient: Tensor::from_floats([3.0, -4.0], &device),
///     step: AdamStep { learning_rate: 0.1, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time: 1 },
/// };
/// let (value, _) = adam_steps(vec![parameter]).remove(0);
/// // The first step has the size of the learning rate, against the gradient's sign.
/// let values = value.into_data().to_vec::<f32>().unwrap();
/// assert!((values[0] + 0.1).abs() < 1e-6 && (values[1] - 0.1).abs() < 1e-6);
/// ```
pub fn adam_steps(parameters: Vec<SteppedParameter>) -> Vec<(Tensor<1>, [Tensor<1>; 2])> {
    if parameters.is_empty() {
        return Vec::new();
    }
    let [mut values, mut firsts, mut seconds, mut gradients] = [(); 4].map(|()| Vec::with_capacity(parameters.len()));
    let mut steps = Vec::with_capacity(parameters.len());
    for SteppedParameter { value, moments: [first, second], gradient, step } in parameters {
        values.push(value.into_dispatch());
        firsts.push(first.into_dispatch());
        seconds.push(second.into_dispatch());
        gradients.push(gradient.into_dispatch());
        steps.push(step);
    }
    let tensors = AdamTensors {
        parameters: TensorList(values),
        first_moments: TensorList(firsts),
        second_moments: TensorList(seconds),
    };
    let out = Dispatch::adam(tensors, TensorList(gradients), steps);
    let moments = out.first_moments.0.into_iter().zip(out.second_moments.0);
    let moments = moments.map(|(first, second)| [first, second].map(Tensor::from_dispatch));
    out.parameters.0.into_iter().map(Tensor::from_dispatch).zip(moments).collect()
}
