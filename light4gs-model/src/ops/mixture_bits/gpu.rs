//! Bits under mixtures of logistics on a GPU.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use cubecl::server::Handle;
use light4gs_shaders::{MIXTURE_BITS, MIXTURE_BITS_BACKWARD, Shader};

use super::super::context::{Gpu, Places, buffer_of, first_words};
use super::super::kernel::Kernel;
use super::super::launch::Launch;
use crate::gpu_error::GpuError;
use crate::kernels::mixture_bits::{INPUTS, MOST_COMPONENTS, MixtureBitsKernels, MixtureTensors};

/// The kernels of this file, for every number of logistics.
pub(super) fn kernels() -> Vec<Kernel> {
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
