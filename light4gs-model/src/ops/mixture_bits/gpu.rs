//! Bits under mixtures of logistics on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{MIXTURE_BITS, MIXTURE_BITS_BACKWARD, Shader};

use super::{INPUTS, MOST_COMPONENTS, MixtureBitsKernels, MixtureInputs, MixtureTensors, mixture_bits};
use crate::gpu::{Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "mixture_bits", kernels, samples: &[sample] };

/// The kernels of this file, for every number of logistics.
fn kernels() -> Vec<Kernel> {
    let of_all = |components| [MIXTURE_BITS, MIXTURE_BITS_BACKWARD].map(|shader| kernel(shader, components));
    (1..=MOST_COMPONENTS).flat_map(of_all).collect()
}

fn kernel(shader: Shader, components: usize) -> Kernel {
    Kernel::new(shader).constant("COMPONENTS", components as u32)
}

/// Inputs of the kernels.
#[derive(Clone, Debug)]
pub struct GpuInputs {
    buffers: [Handle; INPUTS],
    channels: usize,
    /// Values of a channel.
    count: usize,
    components: usize,
    bound: f32,
}

impl GpuInputs {
    fn launch<'a>(&self, gpu: &'a Gpu, shader: Shader) -> Launch<'a> {
        self.buffers.iter().fold(Launch::new(&gpu.client, kernel(shader, self.components)), Launch::reads)
    }

    fn uniform(&self) -> [u32; 4] {
        [self.channels as u32, self.count as u32, self.bound.to_bits(), 0]
    }
}

fn forward(tensors: MixtureTensors<CubeBackend>, bound: f32) -> Result<(CubeTensor, GpuInputs), GpuError> {
    let gpu = Gpu::of(&tensors.values)?;
    let [channels, count] = [0, 1].map(|axis| tensors.values.shape()[axis]);
    let components = tensors.means.shape()[1];
    let buffers = tensors.into_array().map(buffer_of);
    let inputs = GpuInputs { buffers, channels, count, components, bound };
    let bits = gpu.allocate("bits of channels", channels)?;
    inputs.launch(&gpu, MIXTURE_BITS).writes(&bits).uniform(&inputs.uniform()).groups(channels)?;
    Ok((gpu.tensor(first_words(&bits, channels), Shape::from([channels])), inputs))
}

fn backward(inputs: &GpuInputs, upstream: CubeTensor) -> Result<MixtureTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let GpuInputs { channels, count, components, .. } = *inputs;
    let of_values = gpu.allocate("gradients of values", channels * count)?;
    let layout = Places::new(&[1, components, components, components].map(|columns| channels * columns));
    let of_mixture = gpu.allocate("gradients of mixtures", layout.total)?;
    let starts = layout.starts.iter().map(|start| *start as u32);
    let uniform: Vec<u32> = inputs.uniform().into_iter().chain(starts).collect();
    inputs
        .launch(&gpu, MIXTURE_BITS_BACKWARD)
        .reads(&buffer_of(upstream))
        .writes(&of_values)
        .writes(&of_mixture)
        .uniform(&uniform)
        .groups(channels)?;
    let matrix = |handle: Handle, columns: usize| gpu.tensor(handle, Shape::from([channels, columns]));
    Ok(MixtureTensors {
        values: matrix(first_words(&of_values, channels * count), count),
        widths: matrix(layout.of(&of_mixture, 0), 1),
        weight_logits: matrix(layout.of(&of_mixture, 1), components),
        means: matrix(layout.of(&of_mixture, 2), components),
        log_scales: matrix(layout.of(&of_mixture, 3), components),
    })
}

impl MixtureBitsKernels for CubeBackend {
    type Inputs = GpuInputs;

    fn mixture_bits_forward(tensors: MixtureTensors<Self>, bound: f32) -> (CubeTensor, GpuInputs) {
        forward(tensors, bound).unwrap_or_else(|error| error.raise())
    }

    fn mixture_bits_backward(inputs: GpuInputs, gradient: CubeTensor) -> MixtureTensors<Self> {
        backward(&inputs, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + MixtureBitsKernels> MixtureBitsKernels for Fusion<B> {
    type Inputs = B::Inputs;

    fn mixture_bits_forward(tensors: MixtureTensors<Self>, bound: f32) -> (FloatTensor<Self>, B::Inputs) {
        let tensors = MixtureTensors::from_array(tensors.into_array().map(resolve::<B>));
        let (bits, inputs) = B::mixture_bits_forward(tensors, bound);
        (leaf::<B>(bits), inputs)
    }

    fn mixture_bits_backward(inputs: B::Inputs, gradient: FloatTensor<Self>) -> MixtureTensors<Self> {
        let gradients = B::mixture_bits_backward(inputs, resolve::<B>(gradient));
        MixtureTensors::from_array(gradients.into_array().map(leaf::<B>))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let (channels, components) = (9, 3);
    let [values, widths] = [numbers.leaf(channels, 500, -2.0, 2.0), numbers.leaf(channels, 1, 0.01, 0.5)];
    let [weight_logits, means, log_scales] = [
        numbers.leaf(channels, components, -1.0, 1.0),
        numbers.leaf(channels, components, -0.5, 0.5),
        numbers.leaf(channels, components, -3.0, 0.0),
    ];
    let leaves = [&values, &widths, &weight_logits, &means, &log_scales].map(Clone::clone);
    numbers
        .with_gradients(mixture_bits(MixtureInputs { values, widths, weight_logits, means, log_scales }, 1e-9), &leaves)
}
