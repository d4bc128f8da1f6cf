//! Layers over planes `[C, H, W]`: [convolutions](crate::ops::plane_convolution) in PyTorch's weight layouts, and their form for
//! the codec.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::nn::Initializer;
use burn::tensor::{Device, Tensor};
use light4gs_codec::network::{Layer, LayerKind};

use crate::ops::plane_convolution::{PlaneConvolution, convolve};

/// Slope below zero of every leaky ReLU of the entropy models.
pub const LEAKY_SLOPE: f64 = 0.01;

/// Configuration of a [`PlaneConv`]; padding is half the kernel.
#[derive(Config, Debug)]
pub struct PlaneConvConfig {
    /// Input channels.
    pub inputs: usize,
    /// Output channels.
    pub outputs: usize,
    /// Length of the square kernel's side, odd.
    pub kernel: usize,
    /// Rows and columns between outputs.
    #[config(default = 1)]
    pub stride: usize,
    /// Groups, each of which reads its own share of the inputs.
    #[config(default = 1)]
    pub groups: usize,
    /// Whether only taps with row + column odd are used: those that lead from a non-anchor of the checkerboard to
    /// anchors.
    #[config(default = false)]
    pub checkerboard: bool,
}

/// PyTorch's default for convolutions: uniform within `1 / sqrt(fan in)`, biases too.
fn pytorch_uniform<const D: usize>(shape: [usize; D], fan_in: usize, device: &Device) -> Param<Tensor<D>> {
    let bound = 1.0 / (fan_in as f64).sqrt();
    Initializer::Uniform { min: -bound, max: bound }.init(shape, device)
}

impl PlaneConvConfig {
    /// PyTorch's default initialization; masked taps are zero.
    ///
    /// # Panics
    /// If the groups do not divide the channels, or the kernel is even.
    pub fn init(&self, device: &Device) -> PlaneConv {
        let Self { inputs, outputs, kernel, stride, groups, checkerboard } = *self;
        assert!(
            inputs.is_multiple_of(groups) && outputs.is_multiple_of(groups),
            "{groups} groups do not divide {inputs} inputs and {outputs} outputs"
        );
        assert!(!kernel.is_multiple_of(2), "the kernel's side must be odd, not {kernel}");
        let fan_in = inputs / groups * kernel * kernel;
        let weight = pytorch_uniform([outputs, inputs / groups, kernel, kernel], fan_in, device);
        let weight = if checkerboard {
            let mask = checkerboard_kernel(kernel, device);
            Param::from_tensor(weight.val().set_require_grad(false) * mask.unsqueeze::<4>())
        } else {
            weight
        };
        PlaneConv { weight, bias: pytorch_uniform([outputs], fan_in, device), stride, groups, checkerboard }
    }
}

/// `[kernel, kernel]`: 1 where row + column is odd.
pub fn checkerboard_kernel(kernel: usize, device: &Device) -> Tensor<2> {
    let taps: Vec<f32> = (0..kernel * kernel).map(|i| ((i / kernel + i % kernel) % 2) as f32).collect();
    Tensor::<1>::from_floats(taps.as_slice(), device).reshape([kernel, kernel])
}

/// A convolution `[I, H, W]` to `[O, H / stride, W / stride]`.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::PlaneConvConfig;
///
/// let device = Device::flex();
/// let conv = PlaneConvConfig::new(4, 8, 5).with_groups(4).with_checkerboard(true).init(&device);
/// assert_eq!(conv.forward(Tensor::zeros([4, 8, 12], &device)).dims(), [8, 8, 12]);
/// ```
#[derive(Module, Debug)]
pub struct PlaneConv {
    /// `[O, I / groups, kernel, kernel]`.
    pub weight: Param<Tensor<4>>,
    /// `[O]`.
    pub bias: Param<Tensor<1>>,
    stride: usize,
    groups: usize,
    checkerboard: bool,
}

impl PlaneConv {
    /// Groups of channels.
    pub fn groups(&self) -> usize {
        self.groups
    }

    /// The same layer for the codec's exact executor. Strides may be 1 and 2.
    pub fn to_layer(&self) -> Layer {
        let [outputs, inputs, kernel, _] = self.weight.dims();
        let kind = match (self.checkerboard, self.stride) {
            (true, _) => LayerKind::Checkerboard,
            (false, 1) => LayerKind::Convolution,
            _ => LayerKind::Halving,
        };
        Layer {
            kind,
            inputs: (inputs * self.groups) as u32,
            outputs: outputs as u32,
            kernel: kernel as u32,
            groups: self.groups as u32,
            weight: self.weight.val().into_data().iter().collect(),
            bias: self.bias.val().into_data().iter().collect(),
        }
    }

    /// `[O, H / stride, W / stride]` from `[I, H, W]`, borders padded with zeros.
    pub fn forward(&self, plane: Tensor<3>) -> Tensor<3> {
        self.convolved(plane, 1.0)
    }

    /// [`Self::forward`] with zeros at the anchors of the checkerboard, where row + column is odd.
    pub fn without_anchors(&self, plane: Tensor<3>) -> Tensor<3> {
        let convolution = PlaneConvolution { without_anchors: true, ..self.convolution(1.0) };
        convolve(plane, self.weight.val(), self.bias.val(), convolution)
    }

    /// [`Self::forward`], through a leaky ReLU with [`LEAKY_SLOPE`].
    pub fn rectified(&self, plane: Tensor<3>) -> Tensor<3> {
        self.convolved(plane, LEAKY_SLOPE)
    }

    /// [`Self::rectified`] of a plane of which only some channels are given, from `first` on, as the others are zero: products
    /// with zeros are not computed.
    ///
    /// # Panics
    /// If the layer has groups.
    pub fn rectified_part(&self, channels: Tensor<3>, first: usize) -> Tensor<3> {
        assert_eq!(self.groups, 1, "a part of the channels of a layer with groups");
        let weight = self.weight.val().narrow(1, first, channels.dims()[0]);
        convolve(channels, weight, self.bias.val(), self.convolution(LEAKY_SLOPE))
    }

    fn convolved(&self, plane: Tensor<3>, slope: f64) -> Tensor<3> {
        convolve(plane, self.weight.val(), self.bias.val(), self.convolution(slope))
    }

    fn convolution(&self, slope: f64) -> PlaneConvolution {
        let Self { stride, groups, checkerboard, .. } = *self;
        let slope = slope as f32;
        PlaneConvolution { stride, groups, checkerboard, without_anchors: false, transposed: false, slope }
    }
}

/// Configuration of a [`PlaneDeconv`].
#[derive(Config, Debug)]
pub struct PlaneDeconvConfig {
    /// Channels in.
    pub inputs: usize,
    /// Channels out.
    pub outputs: usize,
}

impl PlaneDeconvConfig {
    /// PyTorch's default initialization.
    pub fn init(&self, device: &Device) -> PlaneDeconv {
        // PyTorch takes the second axis of the weight as the fan in, also for transposed convolutions.
        let fan_in = self.outputs * DECONV_KERNEL * DECONV_KERNEL;
        PlaneDeconv {
            weight: pytorch_uniform([self.inputs, self.outputs, DECONV_KERNEL, DECONV_KERNEL], fan_in, device),
            bias: pytorch_uniform([self.outputs], fan_in, device),
        }
    }
}

const DECONV_KERNEL: usize = 5;

/// A transposed convolution with kernel 5, stride 2, padding 2 and output padding 1: `[I, H, W]` to `[O, 2 H, 2 W]`.
#[derive(Module, Debug)]
pub struct PlaneDeconv {
    /// `[I, O, 5, 5]`.
    pub weight: Param<Tensor<4>>,
    /// `[O]`.
    pub bias: Param<Tensor<1>>,
}

impl PlaneDeconv {
    /// The same layer for the codec's exact executor.
    pub fn to_layer(&self) -> Layer {
        let [inputs, outputs, kernel, _] = self.weight.dims();
        Layer {
            kind: LayerKind::Doubling,
            inputs: inputs as u32,
            outputs: outputs as u32,
            kernel: kernel as u32,
            groups: 1,
            weight: self.weight.val().into_data().iter().collect(),
            bias: self.bias.val().into_data().iter().collect(),
        }
    }

    /// `[O, 2 H, 2 W]` from `[I, H, W]`, through a leaky ReLU with [`LEAKY_SLOPE`].
    pub fn rectified(&self, plane: Tensor<3>) -> Tensor<3> {
        let slope = LEAKY_SLOPE as f32;
        let doubling = PlaneConvolution {
            stride: 2,
            groups: 1,
            checkerboard: false,
            without_anchors: false,
            transposed: true,
            slope,
        };
        convolve(plane, self.weight.val(), self.bias.val(), doubling)
    }
}
