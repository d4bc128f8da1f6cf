//! Two layers, from known values of a Gaussian to the distributions of its spherical harmonics.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use light4gs_codec::Network;
use light4gs_codec::network::Value;

use crate::entropy::convolution::{LEAKY_SLOPE, PlaneConv, PlaneConvConfig};

/// Features `[I, 1, N]` to scales and means `[2 C, 1, N]`: linear, ReLU, linear. The Gaussians of the scene are the
/// columns of a plane with one row.
#[derive(Module, Debug)]
pub struct ShNetwork {
    /// I to hidden to 2 C, as 1×1 convolutions.
    pub layers: [PlaneConv; 2],
}

impl ShNetwork {
    /// The last layer starts at scale `scale` and mean 0, with weights of a tenth of PyTorch's.
    pub fn new(inputs: usize, hidden: usize, channels: usize, scale: f32, device: &Device) -> Self {
        let [first, mut last] = [(inputs, hidden), (hidden, 2 * channels)]
            .map(|(inputs, outputs)| PlaneConvConfig::new(inputs, outputs, 1).init(device));
        let bias = [vec![scale; channels], vec![0.0; channels]].concat();
        last.weight = Param::from_tensor(last.weight.val().set_require_grad(false) * 0.1);
        last.bias = Param::from_tensor(Tensor::from_floats(bias.as_slice(), device));
        Self { layers: [first, last] }
    }

    /// `[2 C, 1, N]` from `features [I, 1, N]`.
    pub fn forward(&self, features: Tensor<3>) -> Tensor<3> {
        let [first, last] = &self.layers;
        last.forward(first.rectified(features))
    }

    /// The same computation as [`Self::forward`], for the codec's exact executor.
    pub fn describe(&self, network: &mut Network, features: Value) -> Value {
        let [first, last] = &self.layers;
        let hidden = network.layer(features, first.to_layer());
        let rectified = network.leaky_relu(hidden, LEAKY_SLOPE as f32);
        network.layer(rectified, last.to_layer())
    }
}
