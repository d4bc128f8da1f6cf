//! Elementwise kernels: activations of attributes, the distribution function and the lower bound of the entropy models, columns of
//! matrices, noise.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::CubeTensor;
use light4gs_codec::rendering::MAX_LOGARITHM;
use light4gs_shaders::{
    BOUNDED_EXPONENTIAL, BOUNDED_EXPONENTIAL_BACKWARD, LOWER_BOUND_BACKWARD, NORMAL_CDF, NORMAL_CDF_BACKWARD,
    PLACE_COLUMNS, SIGMOID, SIGMOID_BACKWARD, Shader, UNIFORM_NOISE,
};

use super::context::{Gpu, buffer_of, first_words};
use super::kernel::Kernel;
use super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::activation::{Curve, bound_reached};

/// The kernels of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    let activations = [SIGMOID, SIGMOID_BACKWARD, BOUNDED_EXPONENTIAL, BOUNDED_EXPONENTIAL_BACKWARD];
    let others = [NORMAL_CDF, NORMAL_CDF_BACKWARD, LOWER_BOUND_BACKWARD, PLACE_COLUMNS, UNIFORM_NOISE];
    activations.into_iter().chain(others).map(Kernel::new).collect()
}

/// Launches a kernel that reads tensors of one shape and writes another of the same shape. Its uniform is their size,
/// then `numbers`.
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

fn raised(result: Result<CubeTensor, GpuError>) -> CubeTensor {
    result.unwrap_or_else(|error| error.raise())
}

/// The standard normal distribution function.
pub(crate) fn normal_cdf_on_gpu(places: CubeTensor) -> CubeTensor {
    raised(launch(NORMAL_CDF, [places], &[]))
}

/// The upstream gradient times the standard normal density.
pub(crate) fn normal_cdf_backward_on_gpu(places: CubeTensor, upstream: CubeTensor) -> CubeTensor {
    raised(launch(NORMAL_CDF_BACKWARD, [places, upstream], &[]))
}

/// The upstream gradient where `values >= bound` or the gradient is negative, else zero.
pub(crate) fn lower_bound_backward_on_gpu(values: CubeTensor, upstream: CubeTensor, bound: f32) -> CubeTensor {
    raised(launch(LOWER_BOUND_BACKWARD, [values, upstream], &[bound]))
}

/// An activation of attributes.
pub(crate) fn activation_on_gpu(curve: Curve, places: CubeTensor) -> CubeTensor {
    raised(match curve {
        Curve::Sigmoid => launch(SIGMOID, [places], &[]),
        Curve::BoundedExponential => launch(BOUNDED_EXPONENTIAL, [places], &[MAX_LOGARITHM]),
    })
}

/// The upstream gradient times the slope of the activation where it has these values.
pub(crate) fn activation_backward_on_gpu(curve: Curve, values: CubeTensor, upstream: CubeTensor) -> CubeTensor {
    raised(match curve {
        Curve::Sigmoid => launch(SIGMOID_BACKWARD, [values, upstream], &[]),
        Curve::BoundedExponential => launch(BOUNDED_EXPONENTIAL_BACKWARD, [values, upstream], &[bound_reached()]),
    })
}

/// A matrix `[R, width]` with these columns, from `first` on, and zeros elsewhere.
pub(crate) fn place_columns_on_gpu(columns: CubeTensor, first: usize, width: usize) -> CubeTensor {
    let placed = |gpu: &Gpu| {
        let [rows, count] = columns.shape().dims();
        let size = rows * width;
        let matrix = gpu.allocate("columns among zeros", size)?;
        Launch::new(&gpu.client, PLACE_COLUMNS)
            .reads(&buffer_of(columns.clone()))
            .writes(&matrix)
            .uniform(&[size, width, first, count].map(|number| number as u32))
            .invocations(size)?;
        Ok(gpu.tensor(first_words(&matrix, size), Shape::from([rows, width])))
    };
    raised(Gpu::of(&columns).and_then(|gpu| placed(&gpu)))
}

/// Values with noise of one of the widths `[W]`.
pub(crate) fn uniform_noise_on_gpu(values: CubeTensor, widths: CubeTensor, which: usize, seed: [u32; 2]) -> CubeTensor {
    let noisy = |gpu: &Gpu| {
        let shape = values.shape();
        let count = shape.num_elements();
        let output = gpu.allocate("noisy values", count)?;
        Launch::new(&gpu.client, UNIFORM_NOISE)
            .reads(&buffer_of(values))
            .reads(&buffer_of(widths.clone()))
            .writes(&output)
            .uniform(&[count as u32, which as u32, seed[0], seed[1]])
            .invocations(count)?;
        Ok(gpu.tensor(first_words(&output, count), shape))
    };
    raised(Gpu::of(&widths).and_then(|gpu| noisy(&gpu)))
}
