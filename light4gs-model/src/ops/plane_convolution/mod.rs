//! Convolutions of planes `[C, H, W]` in PyTorch's weight layouts, as a Burn operation with its bias and its leaky ReLU: strides,
//! groups, checkerboard kernels, and the transposed convolution.
//!
//! Burn's own convolutions compute the same in more launches. On its CPU back ends the gradients of grouped convolutions run group
//! by group, and a masked kernel also computes the masked taps, which are left out here.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// The differentiable inputs, or their gradients, in the order in which gradients are registered.
#[derive(Clone, Debug, ExtensionType)]
pub struct ConvolutionTensors<B: Backend> {
    /// `[I, H, W]`.
    pub plane: FloatTensor<B>,
    /// `[O, I / groups, kernel, kernel]`; of a transposed convolution `[I, O, kernel, kernel]`.
    pub weight: FloatTensor<B>,
    /// `[O]`.
    pub bias: FloatTensor<B>,
}

/// How a plane is convolved. Borders are padded with zeros, half a kernel on each side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneConvolution {
    /// Rows and columns between outputs, or between inputs if transposed.
    pub stride: usize,
    /// Groups of channels, each of which reads its own share of the inputs; 1 if transposed.
    pub groups: usize,
    /// Whether only taps with row + column odd are used; the others have no gradient.
    pub checkerboard: bool,
    /// Whether the output is 0 at the anchors, where row + column is odd; not if transposed.
    pub without_anchors: bool,
    /// The transposed convolution: `stride` times as many rows and columns.
    pub transposed: bool,
    /// Slope below zero of the leaky ReLU behind it, above 0; 1 for none.
    pub slope: f32,
}

/// Sizes of a convolution, from the larger plane to the smaller one. A transposed convolution runs from the smaller to the larger.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sizes {
    /// Channels, rows and columns of the larger plane.
    large: [usize; 3],
    /// Of the smaller one.
    small: [usize; 3],
    kernel: usize,
    stride: usize,
    groups: usize,
    checkerboard: bool,
    without_anchors: bool,
}

impl Sizes {
    /// Of a convolution with a plane `[channels, height, width]` and weights of this shape.
    fn new([channels, height, width]: [usize; 3], weight: [usize; 4], convolution: PlaneConvolution) -> Self {
        let PlaneConvolution { stride, groups, checkerboard, without_anchors, transposed, .. } = convolution;
        let (large, small) = if transposed {
            ([weight[1], height * stride, width * stride], [channels, height, width])
        } else {
            ([channels, height, width], [weight[0], height.div_ceil(stride), width.div_ceil(stride)])
        };
        Self { large, small, kernel: weight[2], stride, groups, checkerboard, without_anchors }
    }

    fn of<B: Backend>(plane: &FloatTensor<B>, weight: &FloatTensor<B>, convolution: PlaneConvolution) -> Self {
        let (plane, weight) = (plane.shape(), weight.shape());
        Self::new([0, 1, 2].map(|axis| plane[axis]), [0, 1, 2, 3].map(|axis| weight[axis]), convolution)
    }

    /// The output of the convolution, or of the transposed one.
    fn output(&self, transposed: bool) -> [usize; 3] {
        if transposed { self.large } else { self.small }
    }

    /// Input channels of a group.
    fn inputs_of_group(&self) -> usize {
        self.large[0] / self.groups
    }

    /// Output channels of a group.
    fn outputs_of_group(&self) -> usize {
        self.small[0] / self.groups
    }

    /// Rows times columns of the smaller plane.
    fn places(&self) -> usize {
        self.small[1] * self.small[2]
    }

    /// Row and column of the taps that are used.
    fn taps(&self) -> Vec<[usize; 2]> {
        let all = (0..self.kernel * self.kernel).map(|tap| [tap / self.kernel, tap % self.kernel]);
        all.filter(|[row, column]| !self.checkerboard || (row + column) % 2 == 1).collect()
    }
}

/// State between forward and backward: the inputs without the bias, and the output.
#[derive(Clone, Debug)]
pub struct Convolved<B: Backend> {
    plane: FloatTensor<B>,
    weight: FloatTensor<B>,
    output: FloatTensor<B>,
    convolution: PlaneConvolution,
}

/// A back end's kernels. [`PlaneConvolutionOps`] adds the dispatch and the tape.
pub trait PlaneConvolutionKernels: Backend {
    /// The plane, convolved.
    fn plane_convolution_forward(tensors: ConvolutionTensors<Self>, convolution: PlaneConvolution)
    -> FloatTensor<Self>;

    /// Gradients of the inputs from that of the output.
    fn plane_convolution_backward(saved: Convolved<Self>, gradient: FloatTensor<Self>) -> ConvolutionTensors<Self>;
}

/// The convolution on every back end that has [`PlaneConvolutionKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait PlaneConvolutionOps: Backend {
    /// See [`convolve`].
    fn plane_convolution(
        #[extension_type] tensors: ConvolutionTensors<Self>,
        convolution: PlaneConvolution,
    ) -> FloatTensor<Self>;
}

for_all_back_ends! {
    PlaneConvolutionOps with PlaneConvolutionKernels {
        fn plane_convolution(tensors: ConvolutionTensors<Self>, convolution: PlaneConvolution) -> FloatTensor<Self> {
            Self::plane_convolution_forward(tensors, convolution)
        }
    }
}

impl<B: PlaneConvolutionOps + PlaneConvolutionKernels, C: CheckpointStrategy> PlaneConvolutionOps for Autodiff<B, C> {
    fn plane_convolution(tensors: ConvolutionTensors<Self>, convolution: PlaneConvolution) -> FloatTensor<Self> {
        let tensors = [tensors.plane, tensors.weight, tensors.bias];
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let [plane, weight, bias] = tensors.map(|tensor| tensor.into_primitive());
        let inner = ConvolutionTensors { plane: plane.clone(), weight: weight.clone(), bias };
        let output = B::plane_convolution_forward(inner, convolution);
        let saved = Convolved::<B> { plane, weight, output: output.clone(), convolution };
        recorded::<B, C, _, _>(nodes, (output, saved), |saved, gradient| {
            let gradients = B::plane_convolution_backward(saved, gradient);
            [gradients.plane, gradients.weight, gradients.bias]
        })
    }
}

/// The convolution `[O, H / stride, W / stride]` (rounded up) of `plane [I, H, W]` with `weight [O, I / groups, kernel, kernel]`, or
/// the transposed one `[O, stride H, stride W]` with `weight [I, O, kernel, kernel]`, plus `bias [O]`, through the leaky ReLU.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::plane_convolution::{PlaneConvolution, convolve};
///
/// let device = Device::flex();
/// let plane = Tensor::<3>::from_floats([[[1.0, -2.0, 3.0]]], &device);
/// let weight = Tensor::<4>::ones([1, 1, 3, 3], &device);
/// let convolution = PlaneConvolution { stride: 1, groups: 1, checkerboard: false, without_anchors: false, transposed: false, slope: 0.5 };
/// let output = convolve(plane, weight, Tensor::from_floats([-1.5], &device), convolution);
/// assert_eq!(output.into_data().to_vec::<f32>().unwrap(), [-1.25, 0.5, -0.25]);
/// ```
///
/// # Panics
/// If the shapes do not belong together, the kernel is even, or the slope is not positive.
pub fn convolve(plane: Tensor<3>, weight: Tensor<4>, bias: Tensor<1>, convolution: PlaneConvolution) -> Tensor<3> {
    let PlaneConvolution { stride, groups, transposed, slope, without_anchors, .. } = convolution;
    let (channels, [first, second, rows, columns]) = (plane.dims()[0], weight.dims());
    let (inputs, outputs) = if transposed { (first, second) } else { (second * groups, first) };
    assert_eq!(channels, inputs, "the layer takes {inputs} channels, not {channels}");
    assert_eq!(bias.dims(), [outputs], "bias must have the {outputs} channels of the output");
    assert!(rows == columns && rows % 2 == 1, "the kernel's side must be odd, not {rows}×{columns}");
    assert!(stride > 0 && slope > 0.0, "stride and slope must be positive, not {stride} and {slope}");
    assert!(!(without_anchors && transposed), "anchors of a transposed convolution");
    assert!(outputs.is_multiple_of(groups) && (groups == 1 || !transposed), "{groups} groups of {outputs} outputs");
    Tensor::from_dispatch(Dispatch::plane_convolution(
        ConvolutionTensors { plane: plane.into_dispatch(), weight: weight.into_dispatch(), bias: bias.into_dispatch() },
        convolution,
    ))
}
