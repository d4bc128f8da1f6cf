//! An entropy model of the spherical harmonics of one's own: how wide a Gaussian's view-dependent colors are follows from
//! its constant color and its place. Trained, coded and decoded; nothing of Light4GS is edited.
//!
//! [`ShEntropy`] is the seam. A model gives the bits of each value for training, and describes the network behind them for
//! the codec, which runs it exactly.

use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Distribution, Tensor, TensorData};
use light4gs_codec::{
    CompressionInput, Network, Profile, SceneMeta, ShCoding, ShPrior, ShSource, WeightPrecisions,
    attributes::AttributeSteps, decode, encode_compressed, encode_sh, network::Operation,
};
use light4gs_data::PointCloud;
use light4gs_examples::{Outcome, first_and_last};
use light4gs_model::{
    DeformationConfig, DynamicScene, DynamicSceneConfig, Gaussians, GaussiansConfig, HexPlaneConfig, HexPlaneField,
    HexPlaneFieldConfig, SH_CHANNELS, ShEntropy, ShKnown, ShNetwork, channels_first, channels_last, counted_sh_coding,
    gaussian_bits, round_around,
};

/// Distance between the values of neighboring symbols.
const STEP: f32 = 0.02;

/// From what a decoder knows of a Gaussian to a Gaussian distribution for each of its 45 coefficients.
#[derive(Module, Debug)]
struct FromColorAndPlace {
    network: ShNetwork,
    step: f32,
}

impl FromColorAndPlace {
    fn new(step: f32, device: &Device) -> Self {
        // Inputs, hidden width, channels, standard deviations at the beginning in steps.
        Self { network: ShNetwork::new(6, 12, SH_CHANNELS, 4.0, device), step }
    }

    /// Scales and means `[90, 1, N]` from color and position: Gaussians are the columns of a map with one row.
    fn output(&self, known: &ShKnown) -> Tensor<3> {
        let [count, _, _] = known.sh_dc.dims();
        let color = known.sh_dc.clone().reshape([count, 3]);
        let features = Tensor::cat(vec![color, known.positions.clone()], 1);
        self.network.forward(features.transpose().unsqueeze_dim(1))
    }
}

impl ShEntropy for FromColorAndPlace {
    fn step(&self) -> f32 {
        self.step
    }

    fn bits(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        channels_last(gaussian_bits(channels_first(values), self.output(known), self.step))
    }

    fn quantize(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        channels_last(round_around(channels_first(values.detach()), self.output(known).detach(), self.step))
    }

    // The twin of `output`, as data: the same inputs in the same order, the same layers.
    fn priors(&self) -> Vec<ShPrior> {
        let (mut network, [color, position]) = Network::new([3, 3]);
        let features = network.node(Operation::Concatenate, &[color, position]);
        let output = self.network.describe(&mut network, features);
        network.output(output);
        vec![ShPrior { network, sources: vec![ShSource::Dc, ShSource::Position] }]
    }
}

/// A scene of 600 Gaussians whose view-dependent colors are small on one side and large on the other: what a model that
/// looks at positions can learn, and one table a channel cannot.
fn scene(device: &Device) -> DynamicScene {
    let cloud = PointCloud::random(600, 1.0, 0);
    let hexplane = HexPlaneConfig::new().with_channels(4).with_resolution([8, 8, 8, 4]).with_multipliers(vec![1]);
    let field = HexPlaneFieldConfig::new(hexplane, DeformationConfig::new(0).with_width(8));
    let mut scene = DynamicSceneConfig::<HexPlaneField>::new(GaussiansConfig::new(), field).init(&cloud, device);
    let widths: Vec<f32> = cloud.positions.iter().map(|p| if p[0] > 0.0 { 0.5 } else { 0.02 }).collect();
    let widths = Tensor::<3>::from_data(TensorData::new(widths, [600, 1, 1]), device);
    let normal = Tensor::random([600, 15, 3], Distribution::Normal(0.0, 1.0), device);
    let mut tensors = scene.gaussians.tensors();
    tensors.sh_rest = normal * widths;
    scene.gaussians = Gaussians::from_tensors(tensors);
    scene
}

/// What the decoder has before it reads `sh_rest`.
fn known(scene: &DynamicScene) -> ShKnown {
    let tensors = scene.gaussians.tensors();
    ShKnown { sh_dc: tensors.sh_dc, positions: scene.coordinates.normalize(tensors.means), planes: Vec::new() }
}

fn main() -> Outcome {
    let device = Device::flex();
    device.seed(0);
    let scene = scene(&device);

    // Trained, here on values that stand still: noise in place of rounding, and the bits are the loss.
    let mut model = FromColorAndPlace::new(STEP, &device.clone().autodiff());
    let values = Tensor::from_inner(scene.gaussians.sh_rest.val());
    let ShKnown { sh_dc, positions, planes } = known(&scene);
    let facts = ShKnown { sh_dc: Tensor::from_inner(sh_dc), positions: Tensor::from_inner(positions), planes };
    let mut optimizer = AdamConfig::new().init();
    let mut history = Vec::new();
    for _ in 0..300 {
        let bits = model.bits(model.add_noise(values.clone()), &facts).mean();
        history.push(bits.clone().into_scalar::<f32>());
        let gradients = GradientsParams::from_grads(bits.backward(), &model);
        model = optimizer.step(1e-2, model, gradients);
    }
    let model = model.valid();
    let (first, last) = first_and_last(&history);
    println!("{first:.2} bits a value at first, {last:.2} in the end");
    assert!(last < 0.8 * first);

    // The file has as many bits as training expects, and fewer than with a table for each channel.
    let arrays = scene.to_arrays(SceneMeta::default());
    let coding = model.to_coding(&arrays.gaussians.sh_rest)?;
    let bytes = |coding: &ShCoding| encode_sh(&arrays.gaussians, coding, &arrays.frame, &arrays.hexplane);
    let quantized = model.quantize(scene.gaussians.sh_rest.val(), &known(&scene));
    let bits = model.bits(quantized.clone(), &known(&scene)).sum().into_scalar::<f32>();
    let layers = |prior: &ShPrior| prior.network.layers().map(|layer| layer.weight.len() + layer.bias.len()).sum();
    let weights: usize = model.priors().iter().map(|prior| -> usize { layers(prior) }).sum();
    let (expected, found) = (f64::from(bits) / 8.0, bytes(&coding)?.len() as f64 - 4.0 * weights as f64);
    let tables = bytes(&counted_sh_coding(&arrays.gaussians.sh_rest, SH_CHANNELS, STEP)?)?.len();
    println!("{found:.0} bytes for the values, {expected:.0} expected; {tables} with a table for each channel");
    assert!((found / expected - 1.0).abs() < 0.05);
    assert!(found < tables as f64);

    // Coded and decoded: what comes out is what the Burn module says, but for values on the edge between two symbols.
    let input = CompressionInput {
        profile: Profile::Paper,
        planes: None,
        sh: coding,
        attributes: AttributeSteps::default(),
        weights: WeightPrecisions::default(),
    };
    let decoded = decode(&encode_compressed(&arrays, &input)?.bytes)?.gaussians.sh_rest;
    let ours: Vec<f32> = quantized.into_data().iter::<f32>().collect();
    let close = ours.iter().zip(&decoded).filter(|(ours, exact)| (**ours - **exact).abs() < 1e-4).count();
    println!("{close} of {} values are the same in Burn and in the codec", decoded.len());
    assert!(close as f64 > 0.999 * decoded.len() as f64);
    Ok(())
}
