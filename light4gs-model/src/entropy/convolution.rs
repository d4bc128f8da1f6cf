//! Convolutions over planes `[C, H, W]`, in PyTorch's weight layouts.
//!
//! Each is one matrix product over shifted copies of the plane, one for each tap. Burn's own convolutions compute the
//! same. But on its CPU back ends the gradients of grouped convolutions run group by group, and a masked kernel also
//! computes the masked taps, which are left out here.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::nn::Initializer;
use burn::tensor::ops::PadMode;
use burn::tensor::{Device, Tensor, s};
use light4gs_codec::network::{Layer, LayerKind};

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

    /// Row and column of the unmasked taps.
    fn taps(&self, kernel: usize) -> Vec<[usize; 2]> {
        let all = (0..kernel * kernel).map(|i| [i / kernel, i % kernel]);
        all.filter(|[row, column]| !self.checkerboard || (row + column) % 2 == 1).collect()
    }

    /// `[groups, O / groups, I / groups · taps]`.
    fn weight_matrix(&self, taps: &[[usize; 2]]) -> Tensor<3> {
        let weight = self.weight.val();
        let [outputs, inputs, kernel, _] = weight.dims();
        let weight = if taps.len() == kernel * kernel {
            weight
        } else {
            let places: Vec<i32> = taps.iter().map(|[row, column]| (row * kernel + column) as i32).collect();
            let places = Tensor::from_ints(places.as_slice(), &weight.device());
            weight.reshape([outputs, inputs, kernel * kernel]).select(2, places).unsqueeze::<4>()
        };
        weight.reshape([self.groups, outputs / self.groups, inputs * taps.len()])
    }

    /// `[O, H / stride, W / stride]` from `[I, H, W]`, borders padded with zeros.
    pub fn forward(&self, plane: Tensor<3>) -> Tensor<3> {
        let [outputs, inputs, kernel, _] = self.weight.dims();
        let groups = self.groups;
        let channels = plane.dims()[0];
        assert_eq!(channels, inputs * groups, "the layer takes {} channels, not {channels}", inputs * groups);
        let taps = self.taps(kernel);
        let shifted = ShiftedCopies::of(plane, kernel, self.stride, &taps);
        let places = shifted.places();
        let weight = self.weight_matrix(&taps);
        let product = if groups == 1 {
            weight.squeeze_dim::<2>(0).matmul(shifted.copies.clone().reshape([inputs * taps.len(), places]))
        } else {
            let copies = shifted.copies.clone().reshape([groups, inputs * taps.len(), places]);
            weight.matmul(copies).reshape([outputs, places])
        };
        shifted.crop(product + self.bias.val().unsqueeze_dim::<2>(1))
    }
}

/// For each tap of a kernel, the plane shifted by it, with zeros beyond the borders.
///
/// Rows keep their padding, so that a tap is one contiguous run of a channel instead of a piece of each row. The values
/// in the padding are cropped at the end.
struct ShiftedCopies {
    /// `[C, taps, rows · padded columns]`.
    copies: Tensor<3>,
    rows: usize,
    columns: usize,
    padded_columns: usize,
}

impl ShiftedCopies {
    fn of(plane: Tensor<3>, kernel: usize, stride: usize, taps: &[[usize; 2]]) -> Self {
        let [channels, height, width] = plane.dims();
        let [rows, columns] = [height, width].map(|length| length.div_ceil(stride));
        if kernel == 1 && stride == 1 {
            return Self {
                copies: plane.reshape([channels, 1, height * width]),
                rows,
                columns,
                padded_columns: columns,
            };
        }
        let before = kernel / 2;
        // The reach of the last tap, in strides. One more row is needed, since the last run extends into it by its padding.
        let reach = kernel.div_ceil(stride) - 1;
        let [padded_rows, padded_columns] = [rows + reach + 1, columns + reach];
        let after = |length: usize, padded: usize| (padded * stride).saturating_sub(length + before);
        let padding = [(before, after(height, padded_rows)), (before, after(width, padded_columns))];
        let padded = plane.pad(padding, PadMode::Constant(0.0));
        // One image for each phase of the stride; within it a tap is a plain shift.
        let phases = if stride == 1 {
            padded
        } else {
            let split: Tensor<5> = padded.reshape([channels, padded_rows, stride, padded_columns, stride]);
            split.permute([0, 2, 4, 1, 3]).reshape([channels, stride * stride, padded_rows * padded_columns])
        };
        let phases: Tensor<3> = phases.reshape([channels, stride * stride, padded_rows * padded_columns]);
        let copies = taps.iter().map(|[row, column]| {
            let phase = row % stride * stride + column % stride;
            let start = row / stride * padded_columns + column / stride;
            phases.clone().slice(s![.., phase..phase + 1, start..start + rows * padded_columns])
        });
        Self { copies: Tensor::cat(copies.collect(), 1), rows, columns, padded_columns }
    }

    /// Rows times padded columns.
    fn places(&self) -> usize {
        self.rows * self.padded_columns
    }

    /// `[O, rows, columns]` from `[O, places]`.
    fn crop(&self, product: Tensor<2>) -> Tensor<3> {
        let outputs = product.dims()[0];
        let padded: Tensor<3> = product.reshape([outputs, self.rows, self.padded_columns]);
        if self.padded_columns == self.columns { padded } else { padded.slice(s![.., .., 0..self.columns]) }
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
///
/// An output row 2r + a (a = 0, 1) is computed from the kernel's rows 2m + a and the input's rows r + 1 - m, m = 0, 1,
/// 2. So the four phases of the output are one ordinary 3×3 convolution with four times the channels.
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

    /// `[O, 2 H, 2 W]` from `[I, H, W]`.
    pub fn forward(&self, plane: Tensor<3>) -> Tensor<3> {
        let [inputs, height, width] = plane.dims();
        let outputs = self.bias.dims()[0];
        // In the order of m, that is upwards.
        let neighbors: Vec<[usize; 2]> = (0..9).map(|i| [2 - i / 3, 2 - i % 3]).collect();
        let shifted = ShiftedCopies::of(plane, 3, 1, &neighbors);
        let copies = shifted.copies.clone().reshape([inputs * 9, shifted.places()]);
        // The kernel's sixth row and column do not exist; the axes of [I, O, 3, 2, 3, 2] are then (I, O, m, a, m, a).
        let weight = self.weight.val().pad([(0, 1), (0, 1)], PadMode::Constant(0.0));
        let weight: Tensor<6> = weight.reshape([inputs, outputs, 3, 2, 3, 2]);
        let weight = weight.permute([1, 3, 5, 0, 2, 4]).reshape([outputs * 4, inputs * 9]);
        let phases: Tensor<5> = shifted.crop(weight.matmul(copies)).reshape([outputs, 2, 2, height, width]);
        let plane = phases.permute([0, 3, 1, 4, 2]).reshape([outputs, 2 * height, 2 * width]);
        plane + self.bias.val().reshape([outputs, 1, 1])
    }
}
