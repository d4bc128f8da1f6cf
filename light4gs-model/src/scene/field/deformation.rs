//! The deformation network: from a hexplane feature to changes of a Gaussian's attributes (paper III-A).

use burn::module::{Module, Param};
use burn::nn::{Initializer, Linear, LinearConfig};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::network::{Layer, Value};
use light4gs_codec::{CodecError, MotionNetwork, MotionOutput, MotionSource, Network, checks};
use light4gs_keys::Bounds::{Flag, Whole};
use light4gs_keys::keys;

use super::Offsets;
use crate::ops::columns::columns;
use crate::ops::deformation_network::{NetworkLayout, network};
use crate::ops::linear::layer;
use crate::scene::ModelError;

keys! {
    /// Sizes and heads of the deformation network.
    pub struct DeformationConfig {
        /// Width of the deformation network.
        width: usize = 64; Whole { least: 1, most: 4096 }, "paper, D-NeRF";
        /// Number of the network's layers before its heads. 0 means the same as 1.
        depth: usize = 1; Whole { least: 0, most: 64 }, "reference";
        /// Whether positions move with time.
        position: bool = true; Flag, "reference";
        /// Whether scales change with time.
        scale: bool = true; Flag, "reference";
        /// Whether rotations change with time.
        rotation: bool = true; Flag, "reference";
        /// Whether opacities change with time.
        opacity: bool = false; Flag, "reference: off for D-NeRF and HyperNeRF, on for Neu3D";
        /// Whether spherical harmonics change with time.
        sh: bool = false; Flag, "reference: off for D-NeRF and HyperNeRF, on for Neu3D";
        /// Whether positions also get the gradient that passes through the hexplane query, and not only the gradient of
        /// the rendering. In the reference, this is off.
        differentiate_points: bool = true; Flag, "ours";
    }
}

fn linear(inputs: usize, outputs: usize, device: &Device) -> Linear {
    LinearConfig::new(inputs, outputs).with_initializer(Initializer::XavierUniform { gain: 1.0 }).init(device)
}

impl DeformationConfig {
    /// For each attribute, whether it changes, and its channels.
    fn outputs(&self) -> [(bool, usize); 5] {
        [(self.position, 3), (self.scale, 3), (self.rotation, 4), (self.opacity, 1), (self.sh, 48)]
    }

    /// Refuses a network that no stream can hold, before it takes memory: the largest one within the bounds of `width`
    /// and `depth` would take 17 GB. `features` is the length of the input.
    ///
    /// # Errors
    /// More weights, or more channels of all values together, than a network may have.
    pub fn check_size(&self, features: usize) -> Result<(), CodecError> {
        let (weights, channels) = self.size(features);
        checks::network_size("motion", weights, channels)
    }

    /// Weights with biases, and channels of all values together.
    fn size(&self, features: usize) -> (u64, u64) {
        let [features, width, depth] = [features, self.width, self.depth.max(1)].map(|size| size as u64);
        let outputs = self.outputs().into_iter().filter_map(|(changes, channels)| changes.then_some(channels as u64));
        let outputs: Vec<u64> = outputs.collect();
        let layer = |inputs: u64, outputs: u64| inputs.saturating_add(1).saturating_mul(outputs);
        let sum = |numbers: &mut dyn Iterator<Item = u64>| numbers.fold(0, u64::saturating_add);
        let inner = layer(width, width);
        let heads = outputs.iter().map(|&channels| inner.saturating_add(layer(width, channels)));
        let weights = sum(&mut [layer(features, width), inner.saturating_mul(depth - 1)].into_iter().chain(heads));
        // Every layer except the last one of each head is followed by a ReLU.
        let hidden = depth.saturating_add(outputs.len() as u64).saturating_mul(2).saturating_mul(width);
        let channels = sum(&mut [features, hidden].into_iter().chain(outputs.iter().copied()));
        (weights, channels)
    }

    /// Xavier-uniform weights, for features of a length.
    pub fn init(&self, features: usize, device: &Device) -> Deformation {
        let trunk = (0..self.depth.max(1))
            .map(|layer| linear(if layer == 0 { features } else { self.width }, self.width, device))
            .collect();
        let head = |wanted: bool, outputs: usize| {
            wanted.then(|| DeformationHead {
                hidden: linear(self.width, self.width, device),
                output: linear(self.width, outputs, device),
            })
        };
        let [position, scale, rotation, opacity, sh] = self.outputs().map(|(wanted, channels)| head(wanted, channels));
        Deformation { trunk, position, scale, rotation, opacity, sh }
    }
}

/// ReLU, linear, ReLU, linear: from the trunk's output to the change of one attribute.
#[derive(Module, Debug)]
pub struct DeformationHead {
    /// `[W]` to `[W]`.
    pub hidden: Linear,
    /// `[W]` to the attribute's size.
    pub output: Linear,
}

impl DeformationHead {
    /// `rectified [N, W]` is the trunk's output after its ReLU, which all heads share.
    fn forward(&self, rectified: Tensor<2>) -> Tensor<2> {
        layer(&self.output, relu(layer(&self.hidden, rectified)))
    }

    /// The same computation as [`Self::forward`], for the codec's exact executor.
    fn describe(&self, network: &mut Network, rectified: Value) -> Value {
        let hidden = network.layer(rectified, to_layer(&self.hidden));
        let rectified = network.relu(hidden);
        network.layer(rectified, to_layer(&self.output))
    }
}

/// A trunk and a head for each attribute that changes.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::DeformationConfig;
///
/// let device = Device::flex();
/// let deformation = DeformationConfig { width: 32, ..DeformationConfig::default() }.init(16, &device);
/// let offsets = deformation.forward(Tensor::zeros([5, 16], &device));
/// assert_eq!(offsets.position.unwrap().dims(), [5, 3]);
/// assert!(offsets.sh.is_none());
/// ```
#[derive(Module, Debug)]
pub struct Deformation {
    /// At least one layer.
    pub trunk: Vec<Linear>,
    /// `[N, 3]`.
    pub position: Option<DeformationHead>,
    /// `[N, 3]`.
    pub scale: Option<DeformationHead>,
    /// `[N, 4]`.
    pub rotation: Option<DeformationHead>,
    /// `[N, 1]`.
    pub opacity: Option<DeformationHead>,
    /// `[N, 48]`.
    pub sh: Option<DeformationHead>,
}

impl Deformation {
    /// The trunk's output `[N, W]`, before the heads' ReLU, from features `[N, F]`.
    pub fn hidden(&self, features: Tensor<2>) -> Tensor<2> {
        let mut layers = self.trunk.iter();
        let first = layer(layers.next().expect("a trunk has at least one layer"), features);
        layers.fold(first, |hidden, next| layer(next, relu(hidden)))
    }

    /// Changes of the attributes from features `[N, F]`, N > 0.
    pub fn forward(&self, features: Tensor<2>) -> Offsets {
        let count = features.dims()[0];
        let [position, scale, rotation, opacity, sh] = match self.layout() {
            layout if layout.fits() => self.forward_at_once(&layout, features),
            _ => self.forward_by_layers(features),
        };
        Offsets { position, scale, rotation, opacity, sh: sh.map(|sh| sh.reshape([count, 16, 3])) }
    }

    /// All layers in one operation.
    fn forward_at_once(&self, layout: &NetworkLayout, features: Tensor<2>) -> [Option<Tensor<2>>; 5] {
        let parameters = self.layers().into_iter().map(|layer| {
            let bias = layer.bias.as_ref().expect("a layer with a bias");
            (layer.weight.val(), bias.val())
        });
        let outputs = network(layout, features, parameters);
        let mut first = 0;
        self.heads().map(|(_, head)| {
            head.as_ref().map(|head| {
                let [_, width] = head.output.weight.dims();
                first += width;
                columns(outputs.clone(), first - width..first)
            })
        })
    }

    /// One operation a layer, for a network that is too large for [`Self::forward_at_once`].
    fn forward_by_layers(&self, features: Tensor<2>) -> [Option<Tensor<2>>; 5] {
        let rectified = relu(self.hidden(features));
        self.heads().map(|(_, head)| head.as_ref().map(|head| head.forward(rectified.clone())))
    }

    /// All layers: those of the trunk, then the two of each head.
    fn layers(&self) -> Vec<&Linear> {
        let heads = self.heads().into_iter().filter_map(|(_, head)| head.as_ref());
        self.trunk.iter().chain(heads.flat_map(|head| [&head.hidden, &head.output])).collect()
    }

    fn layout(&self) -> NetworkLayout {
        let mut layout = NetworkLayout::default();
        let trunk = self.trunk.iter().fold(None, |input, layer| Some(layout.add(input, layer.weight.dims())));
        for head in self.heads().into_iter().filter_map(|(_, head)| head.as_ref()) {
            let hidden = layout.add(trunk, head.hidden.weight.dims());
            layout.add(Some(hidden), head.output.weight.dims());
        }
        layout
    }

    fn heads(&self) -> [(MotionOutput, &Option<DeformationHead>); 5] {
        [
            (MotionOutput::Position, &self.position),
            (MotionOutput::LogScale, &self.scale),
            (MotionOutput::Quaternion, &self.rotation),
            (MotionOutput::OpacityLogit, &self.opacity),
            (MotionOutput::Sh, &self.sh),
        ]
    }

    /// The same computation as [`Self::forward`], for the stream and the codec's exact executor.
    pub fn to_motion(&self) -> MotionNetwork {
        let [first, rest @ ..] = &self.trunk[..] else { unreachable!("a trunk has at least one layer") };
        let first = to_layer(first);
        let (mut network, [features]) = Network::new([first.inputs]);
        let first = network.layer(features, first);
        let hidden = rest.iter().fold(first, |hidden, layer| {
            let rectified = network.relu(hidden);
            network.layer(rectified, to_layer(layer))
        });
        let rectified = network.relu(hidden);
        let mut outputs = Vec::new();
        for (output, head) in self.heads() {
            if let Some(head) = head {
                let value = head.describe(&mut network, rectified);
                network.output(value);
                outputs.push(output);
            }
        }
        MotionNetwork { network, sources: vec![MotionSource::Features], outputs }
    }

    /// The inverse of [`Self::to_motion`], for features of a known length.
    ///
    /// # Errors
    /// [`ModelError::Motion`] for a network of another structure.
    pub fn from_motion(motion: &MotionNetwork, feature_size: usize, device: &Device) -> Result<Self, ModelError> {
        let has = |output| motion.outputs.contains(&output);
        let layers: Vec<&Layer> = motion.network.layers().collect();
        let width = layers.first().map_or(0, |layer| layer.outputs as usize);
        let config = DeformationConfig {
            width,
            depth: layers.len().saturating_sub(2 * motion.outputs.len()),
            position: has(MotionOutput::Position),
            scale: has(MotionOutput::LogScale),
            rotation: has(MotionOutput::Quaternion),
            opacity: has(MotionOutput::OpacityLogit),
            sh: has(MotionOutput::Sh),
            ..DeformationConfig::default()
        };
        let other = |what: &str| ModelError::Motion(format!("{what} are not those of a trunk with heads"));
        // Sizes are checked first, so that no memory is taken for weights that are not there.
        let sizes = |layer: &&Layer| {
            layer.weight.len() as u64 == layer.weights() && layer.inputs as usize <= width.max(feature_size)
        };
        if width == 0 || !layers.iter().all(sizes) {
            return Err(other("layers"));
        }
        let mut deformation = config.init(feature_size, device);
        let own = deformation.to_motion();
        if (&own.sources, &own.outputs) != (&motion.sources, &motion.outputs) {
            return Err(other("sources or outputs"));
        }
        if !own.network.has_structure_of(&motion.network) {
            return Err(other("nodes"));
        }
        let Self { trunk, position, scale, rotation, opacity, sh } = &mut deformation;
        let heads = [position, scale, rotation, opacity, sh].into_iter().flatten();
        let linears = trunk.iter_mut().chain(heads.flat_map(|head| [&mut head.hidden, &mut head.output]));
        for (linear, layer) in linears.zip(layers) {
            load(linear, layer, device);
        }
        Ok(deformation)
    }
}

/// Burn has weights as `[inputs, outputs]`, the codec as `[outputs, inputs]`.
pub(super) fn to_layer(linear: &Linear) -> Layer {
    let [_, outputs] = linear.weight.dims();
    let bias = linear.bias.as_ref().map(|bias| bias.val().into_data().iter().collect());
    let weight = linear.weight.val().transpose().into_data().iter().collect();
    Layer::linear(weight, bias.unwrap_or_else(|| vec![0.0; outputs]))
}

pub(super) fn load(linear: &mut Linear, layer: &Layer, device: &Device) {
    let (inputs, outputs) = (layer.inputs as usize, layer.outputs as usize);
    let weight = Tensor::<2>::from_data(TensorData::new(layer.weight.clone(), [outputs, inputs]), device);
    let bias = Tensor::<1>::from_data(TensorData::new(layer.bias.clone(), [outputs]), device);
    // Copied, since a transposed view would be copied again in every product.
    linear.weight = Param::from_tensor(Tensor::from_data(weight.transpose().into_data(), device));
    linear.bias = Some(Param::from_tensor(bias));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_of_the_network() {
        for depth in [0, 1, 3] {
            let config = DeformationConfig { width: 7, depth, rotation: false, sh: true, ..Default::default() };
            let motion = config.init(5, &Device::flex()).to_motion();
            // All layers except the last ones of the heads for positions, scales and harmonics are followed by a ReLU.
            let layers: u64 = motion.network.layers().map(|layer| u64::from(layer.outputs)).sum();
            let weights: usize = motion.network.layers().map(|layer| layer.weight.len() + layer.bias.len()).sum();
            assert_eq!(config.size(5), (weights as u64, 5 + 2 * layers - (3 + 3 + 48)), "depth {depth}");
        }
    }

    #[test]
    fn a_network_that_no_stream_can_hold_is_refused() {
        let sizes = |features: usize, width: usize, depth: usize| {
            DeformationConfig { width, depth, opacity: true, ..Default::default() }.check_size(features)
        };
        assert!(sizes(64, 4096, 1).is_ok());
        assert!(sizes(32, 4096, 17).unwrap_err().to_string().contains("number of weights"));
        assert!(sizes(usize::MAX, usize::MAX, usize::MAX).is_err());
    }
}
