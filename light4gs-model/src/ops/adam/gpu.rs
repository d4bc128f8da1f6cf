//! The fused Adam step on a GPU.

use burn::backend::TensorMetadata;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use light4gs_shaders::ADAM;

use super::super::context::{Gpu, buffer_of};
use super::super::kernel::Kernel;
use super::super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::adam::{AdamStep, AdamTensors};

/// The kernels of this file.
pub(in crate::gpu) fn kernels() -> Vec<Kernel> {
    vec![ADAM.into()]
}

fn step_on_gpu(
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

/// One step on a wgpu device.
pub(crate) fn adam_on_gpu(
    tensors: AdamTensors<CubeBackend>,
    gradient: CubeTensor,
    step: AdamStep,
) -> AdamTensors<CubeBackend> {
    step_on_gpu(tensors, gradient, step).unwrap_or_else(|error| error.raise())
}
