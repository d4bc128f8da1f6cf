//! An entropy model of the spherical harmonics in your own crate: the standard deviation of a Gaussian's view-dependent
//! colors is predicted from its constant color and its position. It is trained with a scene and the rate in its loss,
//! coded and decoded. No file of Light4GS is edited.
//!
//! [`ShEntropy`] is the interface. A model computes the bits of each value for training, and describes its network for
//! the codec, which runs it exactly. [`EntropyModels`] makes the model for a trainer.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs::codec::{Network, ShPrior, ShSource, decode, network::Operation};
use light4gs::data::Scene;
use light4gs::model::{
    BuiltInField, ContextConfig, ContextModel, DynamicScene, PlaneTensors, SH_CHANNELS, ShConfig, ShEntropy, ShKnown,
    ShNetwork, channels_first, channels_last, gaussian_bits, round_around,
};
use light4gs::train::compression::{ConfiguredModels, EntropyModels};
use light4gs::train::config::FileProfile;
use light4gs::train::dataset::load_options;
use light4gs::train::error::TrainError;
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, tiny_config, tiny_scene};

/// From a Gaussian's values that a decoder already has to a normal distribution for each of its 45 coefficients.
#[derive(Module, Debug)]
struct FromColorAndPlace {
    network: ShNetwork,
    step: f32,
}

impl FromColorAndPlace {
    fn new(step: f32, device: &Device) -> Self {
        // Inputs, hidden width, channels, standard deviations at the start in steps.
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

    // The same as `output`, as data: the same inputs in the same order, the same layers.
    fn priors(&self) -> Vec<ShPrior> {
        let (mut network, [color, position]) = Network::new([3, 3]);
        let features = network.node(Operation::Concatenate, &[color, position]);
        let output = self.network.describe(&mut network, features);
        network.output(output);
        vec![ShPrior { network, sources: vec![ShSource::Dc, ShSource::Position] }]
    }
}

/// Makes the entropy models for a trainer: the configured one for the planes, ours for the spherical harmonics.
#[derive(Debug)]
struct WithColorAndPlace;

impl EntropyModels for WithColorAndPlace {
    type Planes = ContextModel;
    type Sh = FromColorAndPlace;

    fn planes(&self, settings: &ContextConfig, channels: usize, device: &Device) -> Result<Self::Planes, TrainError> {
        ConfiguredModels.planes(settings, channels, device)
    }

    fn sh(&self, settings: &ShConfig, _feature_size: usize, device: &Device) -> Result<Self::Sh, TrainError> {
        Ok(FromColorAndPlace::new(settings.step as f32, device))
    }
}

/// The values that the decoder has before it reads `sh_rest`.
fn known(scene: &DynamicScene) -> ShKnown {
    let tensors = scene.gaussians.tensors();
    ShKnown {
        sh_dc: tensors.sh_dc,
        positions: scene.coordinates.normalize(tensors.means),
        planes: PlaneTensors::default(),
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut config = tiny_config()?;
    // All degrees of the harmonics early, and the rate as soon as Gaussians are no longer added or removed.
    config.model.sh_degree = 3;
    config.train.sh_degree_interval = 10;
    config.compression.rate.lambda = 0.03;
    config.compression.rate.from = 10;
    // Weights as float32, so that module and file can be compared symbol by symbol.
    config.compression.profile = FileProfile::Paper;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;

    // Trained: the model is trained with everything else, by the rate in the loss.
    let mut trainer = Trainer::builder(config, data).entropy_models(WithColorAndPlace).build()?;
    let model = |trainer: &Trainer<BuiltInField, WithColorAndPlace>| {
        trainer.compression().and_then(|models| models.sh.clone()).expect("the rate is in the loss").valid()
    };
    let before = model(&trainer).priors();
    while trainer.step()?.is_some() {}
    let model = model(&trainer);
    assert_ne!(model.priors(), before, "the model learns nothing");

    // Coded: the file has as many bits as the training expects.
    let coded = trainer.encode()?;
    let (record, _) = coded.coding.expect("the profile is a coded one");
    let [_, sh, _] = record.parts();
    println!("spherical harmonics: {:.0} bits expected, {:.0} in the file", sh.expected, sh.coded);
    assert!((sh.expected / sh.coded - 1.0).abs() < 0.02);

    // Decoded: the values are those of the Burn module, except on the edge between two symbols. The module gets the
    // values that a decoder has.
    let decoded = decode(&coded.bytes)?;
    let scene = DynamicScene::<BuiltInField>::from_arrays(&decoded, &Device::flex())?;
    let again = model.quantize(scene.gaussians.sh_rest.val(), &known(&scene));
    let ours: Vec<f32> = again.into_data().iter::<f32>().collect();
    let exact = &decoded.gaussians.sh_rest;
    let close = ours.iter().zip(exact).filter(|(ours, exact)| (**ours - **exact).abs() < 1e-3).count();
    println!("{close} of {} values are the same in Burn and in the codec", exact.len());
    assert!(close as f64 > 0.999 * exact.len() as f64);
    // A model of the same kind reads it and gives the same arrays.
    assert_eq!(scene.to_arrays(decoded.meta.clone())?.gaussians, decoded.gaussians);
    Ok(())
}
