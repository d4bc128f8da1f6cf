//! A part of the context model in your own crate: the plane xz is predicted from the plane xy, which is decoded before
//! it, averaged for each x. It is trained with a scene and the rate in its loss, resumed, coded and decoded. No file of
//! Light4GS is edited, and the codec runs the part exactly.
//!
//! A [`PriorPart`] describes one computation twice: `prior` computes it with Burn, for training; `describe` gives it to
//! the codec as a list of layers. A model is a list of parts ([`PlaneEntropy`]), and for each plane the first part that
//! applies is used. [`EntropyModels`] makes the model for a trainer.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs::codec::network::Operation;
use light4gs::codec::plane_layout::{PlaneAxes, PlaneLayout, PlaneShape};
use light4gs::codec::{Network, PlaneCoding, PlaneSource, decode, plane_distributions};
use light4gs::data::Scene;
use light4gs::model::{
    CenteredPlanes, ContextConfig, ContextModel, DescribedCondition, DescribedPrior, FeaturePlanes, Latent, Passes,
    PlaneConv, PlaneConvConfig, PlaneEntropy, Prior, PriorPart, ShConfig, ShEntropyModel,
};
use light4gs::train::compression::{ConfiguredModels, EntropyModels, PlaneModels};
use light4gs::train::dataset::load_options;
use light4gs::train::error::TrainError;
use light4gs::train::run::RunFolder;
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, tiny_config, tiny_scene};

/// The place of the plane xz in the list of a hexplane's planes.
const XZ: usize = 1;

/// xz from the mean of xy over y.
#[derive(Module, Debug)]
struct ProfileAlongX {
    /// `[M, H, W]` to `[2 M, H, W]`: scales and means.
    conv: PlaneConv,
    /// M.
    channels: usize,
}

impl ProfileAlongX {
    /// The planes to which this part applies: xz of the lowest scale, if there is an xy. At higher scales the plane one
    /// scale below is a better predictor.
    fn applies(layout: &PlaneLayout, plane: usize) -> bool {
        let PlaneShape { scale, axes, .. } = layout.planes()[plane];
        scale == 0 && axes == PlaneAxes::Xz && layout.in_same_scale(plane, PlaneAxes::Xy).is_some()
    }
}

impl PriorPart for ProfileAlongX {
    fn prior(&self, planes: &CenteredPlanes, plane: usize, _: Latent) -> Option<Prior> {
        if !Self::applies(planes.layout(), plane) {
            return None;
        }
        let [height, width] = planes.layout().planes()[plane].size;
        // xy is [M, y, x]. Its mean over the rows is spread over the rows of xz, [M, z, x].
        let profile = planes.in_same_scale(plane, PlaneAxes::Xy)?.mean_dim(1);
        let channels = profile.dims()[0];
        let profile = profile.expand([channels, height, width]);
        let parameters = Some(self.conv.forward(profile));
        Some(Prior { parameters, context: None, passes: Passes::AnchorsFirst, latent_bits: None })
    }

    fn describe(&self, layout: &PlaneLayout, plane: usize) -> Option<DescribedPrior> {
        if !Self::applies(layout, plane) {
            return None;
        }
        let (mut network, [xy]) = Network::new([self.channels as u32]);
        let profile = network.node(Operation::MeanOverHeight, &[xy]);
        let profile = network.node(Operation::Spread, &[profile]);
        let parameters = network.layer(profile, self.conv.to_layer());
        network.output(parameters);
        let sources = vec![PlaneSource::SameScale(PlaneAxes::Xy)];
        let parameters = Some(DescribedCondition { network, sources });
        Some(DescribedPrior { parameters, context: None, passes: Passes::AnchorsFirst })
    }
}

/// The usual context model, with our part in front.
#[derive(Module, Debug)]
struct ModelWithProfile {
    usual: ContextModel,
    profile: ProfileAlongX,
}

impl PlaneEntropy for ModelWithProfile {
    fn base(&self) -> &ContextModel {
        &self.usual
    }

    fn base_mut(&mut self) -> &mut ContextModel {
        &mut self.usual
    }

    fn parts(&self) -> Vec<Box<dyn PriorPart + '_>> {
        let mut parts = self.usual.parts();
        parts.insert(0, Box::new(&self.profile));
        parts
    }
}

/// Makes the entropy models for a trainer: ours for the planes, the configured one for the spherical harmonics.
#[derive(Debug)]
struct WithProfile;

impl EntropyModels for WithProfile {
    type Planes = ModelWithProfile;
    type Sh = ShEntropyModel;

    fn planes(&self, settings: &ContextConfig, channels: usize, device: &Device) -> Result<Self::Planes, TrainError> {
        let usual = ConfiguredModels.planes(settings, channels, device)?;
        let conv = PlaneConvConfig::new(channels, 2 * channels, 1).init(device);
        Ok(ModelWithProfile { usual, profile: ProfileAlongX { conv, channels } })
    }

    fn sh(&self, settings: &ShConfig, feature_size: usize, device: &Device) -> Result<Self::Sh, TrainError> {
        ConfiguredModels.sh(settings, feature_size, device)
    }
}

/// The weights of our part, as they are in a training.
fn weights(trainer: &Trainer<light4gs::model::BuiltInField, WithProfile>) -> Vec<f32> {
    let models = trainer.compression().and_then(|models| models.planes.as_ref()).expect("the rate is in the loss");
    models.context.profile.conv.to_layer().weight
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut config = tiny_config()?;
    config.compression.rate.lambda = 0.03;
    config.compression.rate.from = 10;
    config.train.checkpoint_interval = 50;
    let scene = tiny_scene(folder.path())?;
    let data = Scene::open(&scene, &load_options(&config))?;

    // Trained: the part is trained with everything else, by the rate in the loss.
    let run = RunFolder::create(&folder.path().join("run"), Some(&scene), &config, false)?;
    let builder = |data: &Scene| Trainer::builder(config.clone(), data.clone()).entropy_models(WithProfile);
    let mut trainer = builder(&data).run_folder(run.clone()).build()?;
    let before = weights(&trainer);
    while trainer.position() != (light4gs::train::Stage::Fine, 70) {
        trainer.step()?;
    }
    assert_ne!(weights(&trainer), before, "our part learns nothing");
    drop(trainer);

    // Resumed: the checkpoint holds the part, at iteration 50.
    let mut trainer = builder(&data).run_folder(run).resume()?;
    assert_eq!(trainer.position(), (light4gs::train::Stage::Fine, 50));
    trainer.run()?;

    // Coded: the file is as large as the model expects. Any decoder reads it, since the composition is part of the
    // file.
    let coded = trainer.encode()?;
    let (record, _) = coded.coding.expect("the profile is a coded one");
    let [planes, ..] = record.parts();
    println!("planes: {:.0} bits expected, {:.0} in the file", planes.expected, planes.coded);
    assert!((planes.expected / planes.coded - 1.0).abs() < 0.02);
    let decoded = decode(&coded.bytes)?;

    // The codec's exact executor gives the same as the Burn module, to float tolerance.
    let PlaneModels { context: mut model, quantization } =
        trainer.compression().cloned().and_then(|models| models.planes).expect("the rate is in the loss").valid();
    model.base_mut().update_quantiles();
    let steps = quantization.steps_without_gradient();
    let arrays = &decoded.feature_planes;
    let planes = FeaturePlanes::from_arrays(arrays, &Device::flex())?.tensors();
    let symbols = |latent: Tensor<3>| latent.into_data().iter::<f32>().map(|symbol| symbol as i32).collect();
    let latents = model.latent_symbols(&planes, &steps).into_iter();
    let coding = PlaneCoding {
        model: model.to_arrays(planes.layout())?,
        steps: steps.to_groups(planes.layout()),
        latent_symbols: latents.map(|latent| latent.map_or_else(Vec::new, symbols)).collect(),
    };
    let exact = plane_distributions(arrays, &coding, XZ)?;
    let ours = model.plane_parameters(&planes, &steps, &[XZ], Latent::Rounded).remove(0);
    for (ours, exact) in [(ours.means(), exact.means), (ours.scales(), exact.scales)] {
        let ours: Vec<f32> = ours.into_data().iter::<f32>().collect();
        let worst = ours.iter().zip(&exact).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f32::max);
        println!("largest relative difference between Burn and the codec: {worst:e}");
        assert!(worst < 1e-4);
    }
    Ok(())
}
