//! Probabilities of unit intervals on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_shaders::{NORMAL_LIKELIHOOD, NORMAL_LIKELIHOOD_BACKWARD};

use super::{
    Measure, NormalBounds, NormalLikelihoodKernels, NormalLikelihoodOps, NormalTensors, normal_bits, normal_likelihood,
};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "normal_likelihood", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [NORMAL_LIKELIHOOD, NORMAL_LIKELIHOOD_BACKWARD].map(Kernel::new).into()
}

fn uniform(count: usize, bounds: NormalBounds, measure: Measure) -> [u32; 4] {
    [count as u32, bounds.scale.to_bits(), bounds.likelihood.to_bits(), u32::from(measure == Measure::Bits)]
}

fn forward(
    tensors: NormalTensors<CubeBackend>,
    bounds: NormalBounds,
    measure: Measure,
) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&tensors.values)?;
    let shape = tensors.values.shape();
    let count = shape.num_elements();
    let [values, parameters] = tensors.into_array().map(buffer_of);
    let likelihoods = gpu.allocate("likelihoods", count)?;
    let launch = Launch::new(&gpu.client, NORMAL_LIKELIHOOD).reads(&values).reads(&parameters).writes(&likelihoods);
    launch.uniform(&uniform(count, bounds, measure)).invocations(count)?;
    Ok(gpu.tensor(first_words(&likelihoods, count), shape))
}

fn backward(
    tensors: NormalTensors<CubeBackend>,
    bounds: NormalBounds,
    measure: Measure,
    upstream: CubeTensor,
) -> Result<NormalTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let shapes = [tensors.values.shape(), tensors.parameters.shape()];
    let [values, parameters] = tensors.into_array().map(buffer_of);
    let count = shapes[0].num_elements();
    let of_values = gpu.allocate("gradients of values", count)?;
    let of_parameters = gpu.allocate("gradients of parameters", 2 * count)?;
    Launch::new(&gpu.client, NORMAL_LIKELIHOOD_BACKWARD)
        .reads(&values)
        .reads(&parameters)
        .reads(&buffer_of(upstream))
        .writes(&of_values)
        .writes(&of_parameters)
        .uniform(&uniform(count, bounds, measure))
        .invocations(count)?;
    let [of_values_shape, of_parameters_shape] = shapes;
    Ok(NormalTensors {
        values: gpu.tensor(first_words(&of_values, count), of_values_shape),
        parameters: gpu.tensor(first_words(&of_parameters, 2 * count), of_parameters_shape),
    })
}

impl NormalLikelihoodOps for CubeBackend {
    fn normal_likelihood(tensors: NormalTensors<Self>, bounds: NormalBounds, measure: Measure) -> FloatTensor<Self> {
        forward(tensors, bounds, measure).unwrap_or_else(|error| error.raise())
    }
}

impl NormalLikelihoodKernels for CubeBackend {
    fn normal_likelihood_backward(
        tensors: NormalTensors<Self>,
        bounds: NormalBounds,
        measure: Measure,
        upstream: FloatTensor<Self>,
    ) -> NormalTensors<Self> {
        backward(tensors, bounds, measure, upstream).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + NormalLikelihoodOps> NormalLikelihoodOps for Fusion<B> {
    fn normal_likelihood(tensors: NormalTensors<Self>, bounds: NormalBounds, measure: Measure) -> FloatTensor<Self> {
        let tensors = NormalTensors::from_array(tensors.into_array().map(resolve::<B>));
        leaf::<B>(B::normal_likelihood(tensors, bounds, measure))
    }
}

impl<B: FusionBackend + NormalLikelihoodKernels> NormalLikelihoodKernels for Fusion<B> {
    fn normal_likelihood_backward(
        tensors: NormalTensors<Self>,
        bounds: NormalBounds,
        measure: Measure,
        upstream: FloatTensor<Self>,
    ) -> NormalTensors<Self> {
        let tensors = NormalTensors::from_array(tensors.into_array().map(resolve::<B>));
        let gradients = B::normal_likelihood_backward(tensors, bounds, measure, resolve::<B>(upstream));
        NormalTensors::from_array(gradients.into_array().map(leaf::<B>))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let values = numbers.leaf(13, 200, -8.0, 8.0);
    let parameters = numbers.leaf(26, 200, -0.4, 3.0);
    let bounds = NormalBounds { scale: 0.11, likelihood: 1e-9 };
    let likelihoods = normal_likelihood(values.clone(), parameters.clone(), bounds);
    let mut found = numbers.with_gradients(likelihoods, &[values.clone(), parameters.clone()]);
    // A tape serves one backward pass.
    let [values, parameters] = [values, parameters].map(|leaf| leaf.detach().require_grad());
    let bits = normal_bits(values.clone(), parameters.clone(), bounds);
    found.extend(numbers.with_gradients(bits, &[values, parameters]));
    found
}
