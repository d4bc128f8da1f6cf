//! Kernels that make one value of one: the distribution function and the bound of the entropy models.

use burn::backend::TensorMetadata;
use burn_wgpu::CubeTensor;
use light4gs_shaders::{LOWER_BOUND_BACKWARD, NORMAL_CDF, NORMAL_CDF_BACKWARD, Shader};

use super::context::{Gpu, buffer_of, first_words};
use super::kernel::Launch;
use crate::gpu_error::GpuError;

/// Launches a kernel that reads tensors of one shape and writes another one. Its uniform is their size, then `numbers`.
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

/// The upstream gradient where `values >= bound` or it is negative, else zero.
pub(crate) fn lower_bound_backward_on_gpu(values: CubeTensor, upstream: CubeTensor, bound: f32) -> CubeTensor {
    raised(launch(LOWER_BOUND_BACKWARD, [values, upstream], &[bound]))
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor};

    use crate::ops::lower_bound::lower_bound;
    use crate::ops::normal_cdf::normal_cdf;

    /// Values and gradient of a function, at places far into the tails and on both sides of the bound.
    fn run(function: fn(Tensor<1>) -> Tensor<1>, device: Device, count: usize) -> [Vec<f32>; 2] {
        let device = device.autodiff();
        let places: Vec<f32> = (0..count).map(|i| i as f32 * 0.01 - 13.0).collect();
        let leaf = Tensor::<1>::from_floats(places.as_slice(), &device).require_grad();
        let values = function(leaf.clone());
        // Upstream gradients of both signs.
        let signs: Vec<f32> = (0..count).map(|i| [1.0, -0.5, 0.0][i % 3]).collect();
        let signs = Tensor::from_floats(signs.as_slice(), &device);
        let gradients = (values.clone() * signs).sum().backward();
        let gradient = leaf.grad(&gradients).expect("the leaf has a gradient");
        [values.into_data(), gradient.into_data()].map(|data| data.iter::<f32>().collect())
    }

    #[test]
    fn values_and_gradients_are_those_of_the_cpu() {
        for (what, function) in
            [("normal cdf", normal_cdf as fn(Tensor<1>) -> Tensor<1>), ("lower bound", |x| lower_bound(x, 0.11))]
        {
            for count in [0, 1, 2600] {
                let expected = run(function, Device::flex(), count);
                let found = run(function, Device::wgpu(Default::default()), count);
                for (found, expected) in found.iter().zip(&expected) {
                    assert_eq!(found.len(), count);
                    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                        // At -13 a rounding of the exponent, which is -84, is 4e-6 of the value.
                        let allowed = 1e-5 * expected.abs();
                        assert!((found - expected).abs() <= allowed, "{what} {i}: {found} against {expected}");
                    }
                }
            }
        }
    }
}
