//! The fused Adam step on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_shaders::ADAM;

use super::{AdamOps, AdamStep, AdamTensors, adam_step};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "adam", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    vec![ADAM.into()]
}

fn step_of(
    tensors: AdamTensors<CubeBackend>,
    gradient: CubeTensor,
    step: AdamStep,
) -> Result<AdamTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&tensors.parameter)?;
    let shape = tensors.parameter.shape();
    let count = shape.num_elements();
    if count == 0 {
        return Ok(tensors);
    }
    let AdamStep { beta_1, beta_2, epsilon, .. } = step;
    let numbers = [
        beta_1 as f32,
        (1.0 - beta_1) as f32,
        beta_2 as f32,
        (1.0 - beta_2) as f32,
        step.corrected_learning_rate(),
        step.root_correction(),
        epsilon,
    ];
    let uniform: Vec<u32> = std::iter::once(count as u32).chain(numbers.map(f32::to_bits)).collect();
    let new = || gpu.client.empty(4 * count);
    let (parameter, first, second) = (new(), new(), new());
    Launch::new(&gpu.client, ADAM)
        .reads(&buffer_of(tensors.parameter))
        .reads(&buffer_of(gradient))
        .reads(&buffer_of(tensors.first_moment))
        .reads(&buffer_of(tensors.second_moment))
        .writes(&parameter)
        .writes(&first)
        .writes(&second)
        .uniform(&uniform)
        .invocations(count)?;
    Ok(AdamTensors {
        parameter: gpu.tensor(parameter, shape.clone()),
        first_moment: gpu.tensor(first, shape.clone()),
        second_moment: gpu.tensor(second, shape),
    })
}

impl AdamOps for CubeBackend {
    fn adam(tensors: AdamTensors<Self>, gradient: FloatTensor<Self>, step: AdamStep) -> AdamTensors<Self> {
        step_of(tensors, gradient, step).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + AdamOps> AdamOps for Fusion<B> {
    fn adam(tensors: AdamTensors<Self>, gradient: FloatTensor<Self>, step: AdamStep) -> AdamTensors<Self> {
        let AdamTensors { parameter, first_moment, second_moment } = tensors;
        let tensors = AdamTensors {
            parameter: resolve::<B>(parameter),
            first_moment: resolve::<B>(first_moment),
            second_moment: resolve::<B>(second_moment),
        };
        let AdamTensors { parameter, first_moment, second_moment } = B::adam(tensors, resolve::<B>(gradient), step);
        AdamTensors {
            parameter: leaf::<B>(parameter),
            first_moment: leaf::<B>(first_moment),
            second_moment: leaf::<B>(second_moment),
        }
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(device);
    let step = AdamStep { learning_rate: 0.1, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time: 3 };
    let parameter =
        [numbers.matrix(1, 2600, -1.0, 1.0), numbers.matrix(1, 2600, -0.1, 0.1), numbers.matrix(1, 2600, 0.0, 0.1)];
    adam_step(parameter, numbers.matrix(1, 2600, -13.0, 13.0), step).map(|tensor| tensor.into_data()).into()
}
