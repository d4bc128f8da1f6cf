//! Probabilities of intervals under learned densities on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{DENSITY_LIKELIHOOD, DENSITY_LIKELIHOOD_BACKWARD, NETWORK_GATHER, Shader};

use super::{DensityLikelihoodKernels, DensityShape, DensityTensors, INPUTS, MOST_LAYERS, density_likelihood};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// Values of a workgroup.
const BLOCK: usize = 2048;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "density_likelihood", kernels, samples: &[of_one_block, of_blocks] };

/// The kernels of this file, for every number of layers.
fn kernels() -> Vec<Kernel> {
    let of_all = |layers| [DENSITY_LIKELIHOOD, DENSITY_LIKELIHOOD_BACKWARD].map(|shader| kernel(shader, layers));
    (1..=MOST_LAYERS).flat_map(of_all).collect()
}

fn kernel(shader: Shader, layers: usize) -> Kernel {
    Kernel::new(shader).constant("LAYERS", layers as u32).constant("BLOCK", BLOCK as u32)
}

/// Inputs of the kernels.
#[derive(Clone, Debug)]
pub struct GpuInputs {
    buffers: [Handle; INPUTS],
    channels: usize,
    /// Values of a channel.
    count: usize,
    shape: DensityShape,
    width: f32,
}

impl GpuInputs {
    fn launch<'a>(&self, gpu: &'a Gpu, shader: Shader) -> Launch<'a> {
        let kernel = kernel(shader, self.shape.layers().len());
        self.buffers.iter().fold(Launch::new(&gpu.client, kernel), Launch::reads)
    }

    /// Blocks of a channel. At least one, so that the gradients of the parameters are written even without values.
    fn blocks(&self) -> usize {
        self.count.div_ceil(BLOCK).max(1)
    }

    fn uniform(&self) -> Vec<u32> {
        let sizes = [self.channels, self.count, self.blocks(), self.shape.parameters()].map(|size| size as u32);
        let width = [(self.width / 2.0).to_bits(), 0, 0, 0];
        let layers = self.shape.layers().iter().flat_map(|layer| {
            [layer.matrix().start, layer.inputs, layer.outputs, usize::from(layer.bends)].map(|number| number as u32)
        });
        sizes.into_iter().chain(width).chain(layers).collect()
    }
}

fn forward(
    tensors: DensityTensors<CubeBackend>,
    shape: DensityShape,
    width: f32,
) -> Result<(CubeTensor, GpuInputs), GpuError> {
    let gpu = Gpu::of(&tensors.values)?;
    let [channels, count] = [0, 1].map(|axis| tensors.values.shape()[axis]);
    let inputs = GpuInputs { buffers: tensors.into_array().map(buffer_of), channels, count, shape, width };
    let likelihoods = gpu.allocate("probabilities of intervals", channels * count)?;
    inputs
        .launch(&gpu, DENSITY_LIKELIHOOD)
        .writes(&likelihoods)
        .uniform(&inputs.uniform())
        .groups(channels * inputs.blocks())?;
    Ok((gpu.tensor(first_words(&likelihoods, channels * count), Shape::from([channels, count])), inputs))
}

fn backward(inputs: &GpuInputs, upstream: CubeTensor) -> Result<DensityTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let GpuInputs { channels, count, .. } = *inputs;
    let (blocks, size) = (inputs.blocks(), inputs.shape.parameters());
    let of_values = gpu.allocate("gradients of values", channels * count)?;
    let of_blocks = gpu.allocate("gradients of densities by block", blocks * channels * size)?;
    inputs
        .launch(&gpu, DENSITY_LIKELIHOOD_BACKWARD)
        .reads(&buffer_of(upstream))
        .writes(&of_values)
        .writes(&of_blocks)
        .uniform(&inputs.uniform())
        .groups(channels * blocks)?;
    let of_parameters = if blocks == 1 { of_blocks } else { sum_of_blocks(&gpu, &of_blocks, blocks, channels * size)? };
    let matrix = |handle: &Handle, columns: usize| {
        gpu.tensor(first_words(handle, channels * columns), Shape::from([channels, columns]))
    };
    Ok(DensityTensors { values: matrix(&of_values, count), parameters: matrix(&of_parameters, size) })
}

/// The sums of `count` numbers over the blocks, in their order.
fn sum_of_blocks(gpu: &Gpu, of_blocks: &Handle, blocks: usize, count: usize) -> Result<Handle, GpuError> {
    let sums = gpu.allocate("gradients of densities", count)?;
    Launch::new(&gpu.client, NETWORK_GATHER)
        .reads(of_blocks)
        .writes(&sums)
        .uniform(&[blocks as u32, count as u32])
        .invocations(count)?;
    Ok(sums)
}

impl DensityLikelihoodKernels for CubeBackend {
    type Inputs = GpuInputs;

    fn density_likelihood_forward(
        tensors: DensityTensors<Self>,
        shape: DensityShape,
        width: f32,
    ) -> (CubeTensor, GpuInputs) {
        forward(tensors, shape, width).unwrap_or_else(|error| error.raise())
    }

    fn density_likelihood_backward(inputs: GpuInputs, gradient: CubeTensor) -> DensityTensors<Self> {
        backward(&inputs, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + DensityLikelihoodKernels> DensityLikelihoodKernels for Fusion<B> {
    type Inputs = B::Inputs;

    fn density_likelihood_forward(
        tensors: DensityTensors<Self>,
        shape: DensityShape,
        width: f32,
    ) -> (FloatTensor<Self>, B::Inputs) {
        let tensors = DensityTensors::from_array(tensors.into_array().map(resolve::<B>));
        let (likelihoods, inputs) = B::density_likelihood_forward(tensors, shape, width);
        (leaf::<B>(likelihoods), inputs)
    }

    fn density_likelihood_backward(inputs: B::Inputs, gradient: FloatTensor<Self>) -> DensityTensors<Self> {
        let gradients = B::density_likelihood_backward(inputs, resolve::<B>(gradient));
        DensityTensors::from_array(gradients.into_array().map(leaf::<B>))
    }
}

/// Layers of different widths, the last of which does not bend.
fn of_one_block(device: &Device) -> Vec<TensorData> {
    sample(device, &DensityShape::new(&[3, 1, 2], false), 100)
}

fn of_blocks(device: &Device) -> Vec<TensorData> {
    sample(device, &DensityShape::new(&[3, 3, 3, 3], true), BLOCK + 100)
}

fn sample(device: &Device, shape: &DensityShape, count: usize) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let channels = 5;
    let leaves = [numbers.leaf(channels, count, -4.0, 4.0), numbers.leaf(channels, shape.parameters(), -1.0, 1.0)];
    let [values, parameters] = leaves.clone();
    numbers.with_gradients(density_likelihood(values, parameters, shape, 0.5), &leaves)
}
