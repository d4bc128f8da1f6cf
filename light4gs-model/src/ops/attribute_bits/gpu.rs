//! Bits of the attributes on a GPU: a launch forward, two backward.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{ATTRIBUTE_BITS, ATTRIBUTE_BITS_BACKWARD, ATTRIBUTE_BITS_GATHER, Shader};

use super::{
    AttributeBitsInputs, AttributeBitsKernels, AttributeBitsTensors, AttributeChannels, CountedBits, INPUTS,
    MOST_ATTRIBUTES, MOST_COMPONENTS, PositionSet, attribute_bits,
};
use crate::gpu::{Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "attribute_bits", kernels, samples: &[sample] };

/// The kernels of this file, for every number of logistics.
fn kernels() -> Vec<Kernel> {
    let of_all = |components| [ATTRIBUTE_BITS, ATTRIBUTE_BITS_BACKWARD].map(|shader| kernel(shader, components));
    (1..=MOST_COMPONENTS).flat_map(of_all).chain([gathering()]).collect()
}

fn kernel(shader: Shader, components: usize) -> Kernel {
    Kernel::new(shader).constant("COMPONENTS", components as u32).constant("MOST_ATTRIBUTES", MOST_ATTRIBUTES as u32)
}

fn gathering() -> Kernel {
    Kernel::new(ATTRIBUTE_BITS_GATHER).constant("MOST_ATTRIBUTES", MOST_ATTRIBUTES as u32)
}

/// State between forward and backward.
#[derive(Clone, Debug)]
pub struct GpuSaved {
    inputs: [Handle; INPUTS],
    factors: Handle,
    residuals: Handle,
    channels: usize,
    /// Gaussians whose numbers are given.
    count: usize,
    steps: usize,
    components: usize,
    counted: CountedBits,
}

/// Where the results and gradients lie in their buffers.
struct Layout {
    /// Bits, residuals.
    results: Places,
    /// Gradients of the residuals, the channels' steps, weight logits, means, logarithms of scales.
    of_channels: Places,
    /// Gradients of the numbers, the prediction, the logarithms of the steps.
    gathered: Places,
}

impl GpuSaved {
    fn layout(&self) -> Layout {
        let Self { channels, count, steps, components, .. } = *self;
        let mixture = channels * components;
        Layout {
            results: Places::new(&[1 + channels, channels * count]),
            of_channels: Places::new(&[channels * count, channels, mixture, mixture, mixture]),
            gathered: Places::new(&[3 * channels * count, 3 * channels * channels, steps]),
        }
    }

    /// `Parameters` of `shaders/include/attribute_bits.wgsl`.
    fn uniform(&self, layout: &Layout) -> Vec<u32> {
        let Self { channels, count, steps, counted, .. } = self;
        let words = |numbers: [usize; 4]| numbers.map(|number| number as u32);
        let positions = counted.positions.as_ref();
        let (further, by_cells) = positions.map_or((0.0, false), PositionSet::further_bits);
        let [x, y, z] = positions.map_or([0.0; 3], |positions| positions.extent);
        let weights = [counted.weight * counted.share, counted.weight, further, f32::from(u8::from(by_cells))];
        let box_of_positions = [x, y, z, positions.map_or(0.0, PositionSet::scale)];
        let [_, of_steps, logits, means, scales] = layout.of_channels.starts[..] else { unreachable!("five arrays") };
        let place = positions.map_or(0, |positions| positions.place);
        let mut attributes = [[0; 4]; MOST_ATTRIBUTES];
        for (row, AttributeChannels { channels, place }) in attributes.iter_mut().zip(&counted.attributes) {
            *row = words([channels.start, channels.len(), *place, 0]);
        }
        let head = [*channels as u32, *count as u32, *steps as u32, counted.bound.to_bits()];
        [
            head,
            weights.map(f32::to_bits),
            box_of_positions.map(f32::to_bits),
            words([place, layout.results.starts[1], of_steps, 0]),
            words([logits, means, scales, 0]),
            words([layout.gathered.starts[1], layout.gathered.starts[2], 0, 0]),
        ]
        .into_iter()
        .chain(attributes)
        .flatten()
        .collect()
    }
}

fn forward(
    tensors: AttributeBitsTensors<CubeBackend>,
    counted: CountedBits,
) -> Result<(CubeTensor, GpuSaved), GpuError> {
    let gpu = Gpu::of(&tensors.numbers)?;
    let [channels, components] = [0, 1].map(|axis| tensors.means.shape()[axis]);
    let (count, steps) = (tensors.numbers.shape()[1], tensors.log_steps.shape()[0]);
    let (inputs, factors) = tensors.into_parts();
    let (inputs, factors) = (inputs.map(buffer_of), buffer_of(factors));
    let results = Places::new(&[1 + channels, channels * count]);
    let buffer = gpu.allocate("bits and residuals of channels", results.total)?;
    let residuals = results.of(&buffer, 1);
    let saved = GpuSaved { inputs, factors, residuals, channels, count, steps, components, counted };
    let [numbers, prediction, log_steps, weight_logits, means, log_scales] = &saved.inputs;
    Launch::new(&gpu.client, kernel(ATTRIBUTE_BITS, components))
        .reads(numbers)
        .reads(prediction)
        .reads(log_steps)
        .reads(&saved.factors)
        .reads(weight_logits)
        .reads(means)
        .reads(log_scales)
        .writes(&buffer)
        .uniform(&saved.uniform(&saved.layout()))
        .groups(channels + 1)?;
    Ok((gpu.tensor(results.of(&buffer, 0), Shape::from([1 + channels])), saved))
}

fn backward(saved: &GpuSaved, upstream: CubeTensor) -> Result<[CubeTensor; INPUTS], GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let GpuSaved { channels, count, steps, components, .. } = *saved;
    let [numbers, prediction, log_steps, weight_logits, means, log_scales] = &saved.inputs;
    let layout = saved.layout();
    let (uniform, upstream) = (saved.uniform(&layout), buffer_of(upstream));
    let of_channels = gpu.allocate("gradients of residuals and mixtures", layout.of_channels.total)?;
    Launch::new(&gpu.client, kernel(ATTRIBUTE_BITS_BACKWARD, components))
        .reads(&saved.residuals)
        .reads(log_steps)
        .reads(&saved.factors)
        .reads(weight_logits)
        .reads(means)
        .reads(log_scales)
        .reads(&upstream)
        .writes(&of_channels)
        .uniform(&uniform)
        .groups(channels)?;
    let gathered = gpu.allocate("gradients of numbers and predictions", layout.gathered.total)?;
    let inputs = 3 * channels;
    let kernel = gathering();
    let of_numbers = (inputs * count).div_ceil(kernel.invocations());
    Launch::new(&gpu.client, kernel)
        .reads(numbers)
        .reads(prediction)
        .reads(log_steps)
        .reads(&upstream)
        .reads(&of_channels)
        .writes(&gathered)
        .uniform(&uniform)
        .groups(inputs * channels + 1 + of_numbers)?;
    let matrix = |places: &Places, buffer: &Handle, k: usize, [rows, columns]: [usize; 2]| {
        gpu.tensor(first_words(&places.of(buffer, k), rows * columns), Shape::from([rows, columns]))
    };
    let of_mixture = |k: usize| matrix(&layout.of_channels, &of_channels, k, [channels, components]);
    Ok([
        matrix(&layout.gathered, &gathered, 0, [inputs, count]),
        matrix(&layout.gathered, &gathered, 1, [channels, inputs]),
        gpu.tensor(layout.gathered.of(&gathered, 2), Shape::from([steps])),
        of_mixture(2),
        of_mixture(3),
        of_mixture(4),
    ])
}

impl AttributeBitsKernels for CubeBackend {
    type Saved = GpuSaved;

    fn attribute_bits_forward(tensors: AttributeBitsTensors<Self>, counted: CountedBits) -> (CubeTensor, GpuSaved) {
        forward(tensors, counted).unwrap_or_else(|error| error.raise())
    }

    fn attribute_bits_backward(saved: GpuSaved, gradient: CubeTensor) -> [CubeTensor; INPUTS] {
        backward(&saved, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + AttributeBitsKernels> AttributeBitsKernels for Fusion<B> {
    type Saved = B::Saved;

    fn attribute_bits_forward(
        tensors: AttributeBitsTensors<Self>,
        counted: CountedBits,
    ) -> (FloatTensor<Self>, B::Saved) {
        let (differentiable, factors) = tensors.into_parts();
        let tensors = AttributeBitsTensors::from_parts(differentiable.map(resolve::<B>), resolve::<B>(factors));
        let (bits, saved) = B::attribute_bits_forward(tensors, counted);
        (leaf::<B>(bits), saved)
    }

    fn attribute_bits_backward(saved: B::Saved, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; INPUTS] {
        B::attribute_bits_backward(saved, resolve::<B>(gradient)).map(leaf::<B>)
    }
}

/// Two attributes and the positions, whose step is between theirs.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut random = Numbers::new(&device.clone().autodiff());
    let (channels, components) = (9, 3);
    let numbers = random.leaf(3 * channels, 500, -1.0, 1.0);
    let prediction = random.leaf(channels, 3 * channels, -0.3, 0.3);
    let log_steps = random.leaf(1, 3, -3.0, -1.0);
    let [weight_logits, means, log_scales] = [
        random.leaf(channels, components, -1.0, 1.0),
        random.leaf(channels, components, -0.5, 0.5),
        random.leaf(channels, components, -3.0, 0.0),
    ];
    let leaves = [&numbers, &prediction, &log_steps, &weight_logits, &means, &log_scales].map(Clone::clone);
    let factors = random.matrix(1, 3, 0.5, 1.5).flatten(0, 1);
    let inputs = AttributeBitsInputs {
        numbers,
        prediction,
        log_steps: log_steps.flatten(0, 1),
        weight_logits,
        means,
        log_scales,
        factors,
    };
    let attributes = [(0..4, 2), (4..9, 0)].map(|(channels, place)| AttributeChannels { channels, place }).into();
    let positions = Some(PositionSet { place: 1, extent: [3.0, 20.0, 0.5], count: 2000, coded: None });
    let counted = CountedBits { attributes, positions, bound: 1e-9, share: 4.0, weight: 0.1 };
    random.with_gradients(attribute_bits(inputs, counted), &leaves)
}
