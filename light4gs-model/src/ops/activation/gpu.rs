//! The activations of attributes on a GPU.

use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::CubeBackend;
use light4gs_shaders::{BOUNDED_EXPONENTIAL, BOUNDED_EXPONENTIAL_BACKWARD, SIGMOID, SIGMOID_BACKWARD};

use super::{ActivationKernels, ActivationOps, Curve, bound_reached, bounded_exponential, sigmoid};
use crate::gpu::{Kernel, elementwise};
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "activation", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [SIGMOID, SIGMOID_BACKWARD, BOUNDED_EXPONENTIAL, BOUNDED_EXPONENTIAL_BACKWARD].map(Kernel::new).into()
}

impl ActivationOps for CubeBackend {
    fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        match curve {
            Curve::Sigmoid => elementwise(SIGMOID, [tensor], &[]),
            Curve::BoundedExponential => elementwise(BOUNDED_EXPONENTIAL, [tensor], &[]),
        }
    }
}

impl ActivationKernels for CubeBackend {
    fn activation_backward(curve: Curve, values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        let inputs = [values, upstream];
        match curve {
            Curve::Sigmoid => elementwise(SIGMOID_BACKWARD, inputs, &[]),
            Curve::BoundedExponential => elementwise(BOUNDED_EXPONENTIAL_BACKWARD, inputs, &[bound_reached()]),
        }
    }
}

impl<B: FusionBackend + ActivationOps> ActivationOps for Fusion<B> {
    fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::activation(curve, resolve::<B>(tensor)))
    }
}

impl<B: FusionBackend + ActivationKernels> ActivationKernels for Fusion<B> {
    fn activation_backward(curve: Curve, values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::activation_backward(curve, resolve::<B>(values), resolve::<B>(upstream)))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let place = numbers.leaf(1, 2600, -13.0, 13.0);
    let mut values = numbers.with_gradients(sigmoid(place.clone()), std::slice::from_ref(&place));
    values.extend(numbers.with_gradients(bounded_exponential(place.clone()), &[place]));
    values
}
