//! Launches of kernels that compute value by value.

use burn::backend::TensorMetadata;
use burn_wgpu::CubeTensor;
use light4gs_shaders::Shader;

use super::context::{Gpu, buffer_of, first_words};
use super::launch::Launch;
use crate::gpu_error::GpuError;

/// Launches a kernel that reads tensors of one shape and writes another of the same shape. Its uniform is their size,
/// then `numbers`.
///
/// # Panics
/// If the device fails, with the error that names the kernel.
pub(crate) fn elementwise<const K: usize>(shader: Shader, inputs: [CubeTensor; K], numbers: &[f32]) -> CubeTensor {
    launch(shader, inputs, numbers).unwrap_or_else(|error| error.raise())
}

fn launch<const K: usize>(shader: Shader, inputs: [CubeTensor; K], numbers: &[f32]) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&inputs[0])?;
    let shape = inputs[0].shape();
    debug_assert!(inputs.iter().all(|input| input.shape() == shape), "{}: different shapes", shader.name);
    let count = shape.num_elements();
    let output = gpu.allocate(shader.name, count)?;
    let uniform: Vec<u32> =
        std::iter::once(count as u32).chain(numbers.iter().map(|number| number.to_bits())).collect();
    let inputs = inputs.map(buffer_of);
    let launch = inputs.iter().fold(Launch::new(&gpu.client, shader), Launch::reads);
    launch.writes(&output).uniform(&uniform).invocations(count)?;
    Ok(gpu.tensor(first_words(&output, count), shape))
}
