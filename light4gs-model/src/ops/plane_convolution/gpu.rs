//! Convolutions of planes on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{PLANE_CONVOLUTION, PLANE_CONVOLUTION_TRANSPOSED, PLANE_CONVOLUTION_WEIGHTS};

use super::{ConvolutionTensors, Convolved, PlaneConvolution, PlaneConvolutionKernels, Sizes, convolve};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "plane_convolution", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [PLANE_CONVOLUTION, PLANE_CONVOLUTION_TRANSPOSED, PLANE_CONVOLUTION_WEIGHTS].map(Kernel::new).into()
}

/// What a convolution reads beside plane and weights, and the slope of the leaky ReLU.
#[derive(Clone, Copy)]
enum Beside<'a> {
    /// Forward: the bias.
    Bias(&'a Handle, f32),
    /// Backward: the output, which has the sign of what went into the leaky ReLU. The plane is its gradient.
    Output(&'a Handle, f32),
}

impl Sizes {
    fn uniform(&self, slope: f32, forward: bool, transposed: bool) -> [u32; 12] {
        let [large, small] = [self.large, self.small].map(|sizes| sizes.map(|size| size as u32));
        let [kernel, stride, groups] = [self.kernel, self.stride, self.groups].map(|number| number as u32);
        let flags = u32::from(self.checkerboard)
            | u32::from(forward) << 1
            | u32::from(transposed) << 2
            | u32::from(self.without_anchors) << 3;
        [large[0], large[1], large[2], flags, small[0], small[1], small[2], slope.to_bits(), kernel, stride, groups, 0]
    }

    /// The smaller plane from the larger one, or with `transposed` the other way round.
    fn convolved(
        &self,
        gpu: &Gpu,
        [plane, weight]: [&Handle; 2],
        beside: Beside,
        transposed: bool,
    ) -> Result<CubeTensor, GpuError> {
        let shape = self.output(transposed);
        let count = shape.iter().product();
        let output = gpu.allocate("convolved plane", count)?;
        let shader = if transposed { PLANE_CONVOLUTION_TRANSPOSED } else { PLANE_CONVOLUTION };
        let (beside, slope, forward) = match beside {
            Beside::Bias(bias, slope) => (bias, slope, true),
            Beside::Output(output, slope) => (output, slope, false),
        };
        let launch = Launch::new(&gpu.client, shader).reads(plane).reads(weight).reads(beside).writes(&output);
        launch.uniform(&self.uniform(slope, forward, transposed)).invocations(count)?;
        Ok(gpu.tensor(first_words(&output, count), Shape::from(shape)))
    }
}

fn forward(tensors: ConvolutionTensors<CubeBackend>, convolution: PlaneConvolution) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&tensors.plane)?;
    let sizes = Sizes::of::<CubeBackend>(&tensors.plane, &tensors.weight, convolution);
    let [plane, weight, bias] = [tensors.plane, tensors.weight, tensors.bias].map(buffer_of);
    sizes.convolved(&gpu, [&plane, &weight], Beside::Bias(&bias, convolution.slope), convolution.transposed)
}

fn backward(saved: Convolved<CubeBackend>, gradient: CubeTensor) -> Result<ConvolutionTensors<CubeBackend>, GpuError> {
    let gpu = Gpu::of(&gradient)?;
    let Convolved { plane, weight, output, convolution } = saved;
    let PlaneConvolution { slope, transposed, .. } = convolution;
    let weight_shape = weight.shape();
    let sizes = Sizes::of::<CubeBackend>(&plane, &weight, convolution);
    let [plane, weight, gradient, output] = [plane, weight, gradient, output].map(buffer_of);
    let of_plane = sizes.convolved(&gpu, [&gradient, &weight], Beside::Output(&output, slope), !transposed)?;

    let count = weight_shape.num_elements();
    let of_weight = gpu.allocate("gradients of weights", count)?;
    let channels = sizes.output(transposed)[0];
    let of_bias = gpu.allocate("gradients of biases", channels)?;
    let (large, small) = if transposed { (&gradient, &plane) } else { (&plane, &gradient) };
    Launch::new(&gpu.client, PLANE_CONVOLUTION_WEIGHTS)
        .reads(large)
        .reads(small)
        .reads(&output)
        .writes(&of_weight)
        .writes(&of_bias)
        .uniform(&sizes.uniform(slope, false, transposed))
        .groups(sizes.small[0] * sizes.inputs_of_group() + channels)?;
    Ok(ConvolutionTensors {
        plane: of_plane,
        weight: gpu.tensor(first_words(&of_weight, count), weight_shape),
        bias: gpu.tensor(first_words(&of_bias, channels), Shape::from([channels])),
    })
}

impl PlaneConvolutionKernels for CubeBackend {
    fn plane_convolution_forward(
        tensors: ConvolutionTensors<Self>,
        convolution: PlaneConvolution,
    ) -> FloatTensor<Self> {
        forward(tensors, convolution).unwrap_or_else(|error| error.raise())
    }

    fn plane_convolution_backward(saved: Convolved<Self>, gradient: FloatTensor<Self>) -> ConvolutionTensors<Self> {
        backward(saved, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + PlaneConvolutionKernels> PlaneConvolutionKernels for Fusion<B> {
    fn plane_convolution_forward(
        tensors: ConvolutionTensors<Self>,
        convolution: PlaneConvolution,
    ) -> FloatTensor<Self> {
        let [plane, weight, bias] = [tensors.plane, tensors.weight, tensors.bias].map(resolve::<B>);
        leaf::<B>(B::plane_convolution_forward(ConvolutionTensors { plane, weight, bias }, convolution))
    }

    fn plane_convolution_backward(saved: Convolved<Self>, gradient: FloatTensor<Self>) -> ConvolutionTensors<Self> {
        let Convolved { plane, weight, output, convolution } = saved;
        let [plane, weight, output] = [plane, weight, output].map(resolve::<B>);
        let saved = Convolved { plane, weight, output, convolution };
        let ConvolutionTensors { plane, weight, bias } = B::plane_convolution_backward(saved, resolve::<B>(gradient));
        ConvolutionTensors { plane: leaf::<B>(plane), weight: leaf::<B>(weight), bias: leaf::<B>(bias) }
    }
}

/// Strides, groups, a checkerboard kernel, the transposed convolution; with and without the leaky ReLU.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let plain = PlaneConvolution {
        stride: 1,
        groups: 1,
        checkerboard: false,
        without_anchors: false,
        transposed: false,
        slope: 0.01,
    };
    let cases = [
        ([4, 6, 1], plain),
        ([6, 4, 5], PlaneConvolution { groups: 2, checkerboard: true, without_anchors: true, slope: 1.0, ..plain }),
        ([3, 5, 5], PlaneConvolution { stride: 2, ..plain }),
        ([3, 4, 5], PlaneConvolution { stride: 2, transposed: true, ..plain }),
    ];
    let mut values = Vec::new();
    for ([inputs, outputs, kernel], convolution) in cases {
        let plane = numbers.leaf(inputs, 8 * 13, -1.0, 1.0);
        let weights = kernel * kernel * inputs / convolution.groups;
        let [weight, bias] = [numbers.leaf(outputs, weights, -0.5, 0.5), numbers.leaf(1, outputs, -0.5, 0.5)];
        let shape = if convolution.transposed { [inputs, outputs] } else { [outputs, inputs / convolution.groups] };
        let output = convolve(
            plane.clone().reshape([inputs, 8, 13]),
            weight.clone().reshape([shape[0], shape[1], kernel, kernel]),
            bias.clone().squeeze_dim(0),
            convolution,
        );
        values.extend(numbers.with_gradients(output, &[plane, weight, bias]));
    }
    values
}
