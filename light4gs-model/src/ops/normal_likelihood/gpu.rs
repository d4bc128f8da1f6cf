//! Probabilities of unit intervals on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_shaders::{NORMAL_LIKELIHOOD, NORMAL_LIKELIHOOD_BACKWARD};

use super::{NormalBounds, NormalLikelihoodKernels, NormalLikelihoodOps, NormalTensors, normal_likelihood};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, elementwise, first_words};
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

fn backward(
    tensors: NormalTensors<CubeBackend>,
    bounds: NormalBounds,
    upstream: CubeTensor,
) -> Result<NormalTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let shape = upstream.shape();
    let count = shape.num_elements();
    let [values, means, scales] = tensors.into_array().map(buffer_of);
    let of_values = gpu.allocate("gradients of values", count)?;
    let of_means = gpu.allocate("gradients of means", count)?;
    let of_scales = gpu.allocate("gradients of scales", count)?;
    Launch::new(&gpu.client, NORMAL_LIKELIHOOD_BACKWARD)
        .reads(&values)
        .reads(&means)
        .reads(&scales)
        .reads(&buffer_of(upstream))
        .writes(&of_values)
        .writes(&of_means)
        .writes(&of_scales)
        .uniform(&[count as u32, bounds.scale.to_bits(), bounds.likelihood.to_bits()])
        .invocations(count)?;
    let gradients = [of_values, of_means, of_scales];
    Ok(NormalTensors::from_array(gradients.map(|buffer| gpu.tensor(first_words(&buffer, count), shape.clone()))))
}

impl NormalLikelihoodOps for CubeBackend {
    fn normal_likelihood(tensors: NormalTensors<Self>, bounds: NormalBounds) -> FloatTensor<Self> {
        elementwise(NORMAL_LIKELIHOOD, tensors.into_array(), &[bounds.scale, bounds.likelihood])
    }
}

impl NormalLikelihoodKernels for CubeBackend {
    fn normal_likelihood_backward(
        tensors: NormalTensors<Self>,
        bounds: NormalBounds,
        upstream: FloatTensor<Self>,
    ) -> NormalTensors<Self> {
        backward(tensors, bounds, upstream).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + NormalLikelihoodOps> NormalLikelihoodOps for Fusion<B> {
    fn normal_likelihood(tensors: NormalTensors<Self>, bounds: NormalBounds) -> FloatTensor<Self> {
        let tensors = NormalTensors::from_array(tensors.into_array().map(resolve::<B>));
        leaf::<B>(B::normal_likelihood(tensors, bounds))
    }
}

impl<B: FusionBackend + NormalLikelihoodKernels> NormalLikelihoodKernels for Fusion<B> {
    fn normal_likelihood_backward(
        tensors: NormalTensors<Self>,
        bounds: NormalBounds,
        upstream: FloatTensor<Self>,
    ) -> NormalTensors<Self> {
        let tensors = NormalTensors::from_array(tensors.into_array().map(resolve::<B>));
        let gradients = B::normal_likelihood_backward(tensors, bounds, resolve::<B>(upstream));
        NormalTensors::from_array(gradients.into_array().map(leaf::<B>))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let [values, means] = [numbers.leaf(13, 200, -8.0, 8.0), numbers.leaf(13, 200, -2.0, 2.0)];
    let scales = numbers.leaf(13, 200, -0.2, 3.0);
    let bounds = NormalBounds { scale: 0.11, likelihood: 1e-9 };
    let leaves = [&values, &means, &scales].map(Clone::clone);
    numbers.with_gradients(normal_likelihood(values, means, scales, bounds), &leaves)
}
