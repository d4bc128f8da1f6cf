//! The gradient of a lower bound on a GPU.

use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::CubeBackend;
use light4gs_shaders::LOWER_BOUND_BACKWARD;

use super::{LowerBoundKernels, lower_bound, masked_gradient};
use crate::gpu::{Kernel, elementwise};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "lower_bound", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    vec![LOWER_BOUND_BACKWARD.into()]
}

impl LowerBoundKernels for CubeBackend {
    fn lower_bound_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>, bound: f32) -> FloatTensor<Self> {
        elementwise(LOWER_BOUND_BACKWARD, [tensor, upstream], &[bound])
    }
}

/// A fusion stream fuses these operations without our help.
impl<B: FusionBackend> LowerBoundKernels for Fusion<B> {
    fn lower_bound_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>, bound: f32) -> FloatTensor<Self> {
        masked_gradient::<Self>(tensor, upstream, bound)
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let values = numbers.leaf(1, 2600, -1.0, 1.0);
    numbers.with_gradients(lower_bound(values.clone(), 0.11), &[values])
}
