//! From the priors of a plane to the Gaussian of each value.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor};
use light4gs_codec::Network;
use light4gs_codec::network::Operation;

use crate::entropy::convolution::{LEAKY_SLOPE, PlaneConv, PlaneConvConfig};
use crate::entropy::gaussian_conditional::NormalParameters;

/// The initial values of the last layer.
#[derive(Config, Debug, PartialEq)]
pub enum Start {
    /// PyTorch's default: scales near 0, where symbols take the most bits and gradients are smallest.
    PyTorch,
    /// Scales near 1, means near 0, with a tenth of PyTorch's weights.
    Unit,
}

/// Configuration of [`EntropyParameters`].
#[derive(Config, Debug)]
pub struct EntropyParametersConfig {
    /// Channels of a plane, M.
    pub channels: usize,
    /// Widths of the two hidden layers, C and D.
    pub hidden: [usize; 2],
    /// The initial values of the last layer.
    #[config(default = "Start::Unit")]
    pub start: Start,
}

impl EntropyParametersConfig {
    /// PyTorch's default initialization, except in the last layer; see [`Start`].
    pub fn init(&self, device: &Device) -> EntropyParameters {
        let Self { channels, hidden: [first, second], .. } = *self;
        let mut parameters = EntropyParameters {
            layers: [(4 * channels, first), (first, second), (second, 2 * channels)]
                .map(|(inputs, outputs)| PlaneConvConfig::new(inputs, outputs, 1).init(device)),
        };
        if self.start == Start::Unit {
            parameters.start_from(&vec![0.0; channels], &vec![1.0; channels]);
        }
        parameters
    }
}

/// A network at every place: parameters `[2 M]` and context `[2 M]` to scales `[M]` and means `[M]`.
#[derive(Module, Debug)]
pub struct EntropyParameters {
    /// 1×1 convolutions 4 M to C to D to 2 M, with ReLUs between them.
    pub layers: [PlaneConv; 3],
}

impl EntropyParameters {
    /// Channels of a plane.
    pub fn channels(&self) -> usize {
        let [.., last] = &self.layers;
        last.bias.dims()[0] / 2
    }

    /// The same computation as [`Self::forward`], for the codec's exact executor: from parameters and context to
    /// scales, then means.
    pub fn network(&self) -> Network {
        let [first, rest @ ..] = &self.layers;
        let first = first.to_layer();
        let half = first.inputs / 2;
        let (mut network, [parameters, context]) = Network::new([half, half]);
        let known = network.node(Operation::Concatenate, &[parameters, context]);
        let hidden = network.layer(known, first);
        let output = rest.iter().fold(hidden, |hidden, layer| {
            let rectified = network.leaky_relu(hidden, LEAKY_SLOPE as f32);
            network.layer(rectified, layer.to_layer())
        });
        network.output(output);
        network
    }

    /// Normal distributions `[M, H, W]` of the values of a plane of this size (height, width), in units of its step,
    /// from `parameters` and `context [2 M, H, W]`; `None` means zeros.
    pub fn forward(
        &self,
        parameters: Option<Tensor<3>>,
        context: Option<Tensor<3>>,
        [height, width]: [usize; 2],
    ) -> NormalParameters<3> {
        let [first, second, last] = &self.layers;
        let hidden = match (parameters, context) {
            (Some(parameters), Some(context)) => first.rectified(Tensor::cat(vec![parameters, context], 0)),
            (Some(parameters), None) => first.rectified_part(parameters, 0),
            (None, Some(context)) => first.rectified_part(context.clone(), context.dims()[0]),
            (None, None) => {
                let bias: Tensor<3> = first.bias.val().reshape([-1, 1, 1]);
                let outputs = bias.dims()[0];
                leaky_relu(bias, LEAKY_SLOPE).expand([outputs, height, width])
            }
        };
        NormalParameters::of_network(last.forward(second.rectified(hidden)))
    }

    /// Makes the network give approximately this mean and scale (in steps) for each channel, for any input: they become
    /// the last layer's biases, and its weights are multiplied by a tenth of the channel's scale. So a weight changes
    /// an output by about as many standard deviations in a channel that spans hundreds of symbols as in one that spans
    /// two. Call it only once.
    pub fn start_from(&mut self, means: &[f32], scales: &[f32]) {
        let [.., last] = &mut self.layers;
        let device = last.bias.val().device();
        last.weight = Param::from_tensor(last.weight.val().set_require_grad(false) * 0.1);
        last.bias = Param::from_tensor(Tensor::from_floats([scales, means].concat().as_slice(), &device));
    }
}
