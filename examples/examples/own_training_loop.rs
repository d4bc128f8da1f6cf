//! The splatter and the hexplane query with your own model, training loop and loss.
//!
//! Nothing of `light4gs-train` is used: Gaussians that only move, Burn's own Adam, a squared error.

use burn::module::Module;
use burn::nn::{Linear, LinearConfig};
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Tensor, activation::tanh};
use light4gs::data::{ImageStore, LoadOptions, Scene};
use light4gs::model::{FeaturePlanes, GaussianTensors, Gaussians, GaussiansConfig, HexPlaneConfig, Splatter};
use light4gs_examples::{Outcome, image_tensor, tiny_scene};

/// Gaussians, features over space and time, and one layer that turns a feature into a shift.
#[derive(Module, Debug)]
struct MovingGaussians {
    gaussians: Gaussians,
    hexplane: FeaturePlanes,
    shift: Linear,
}

impl MovingGaussians {
    /// Raw attributes at a time in [0, 1].
    fn at(&self, time: f32) -> GaussianTensors {
        let mut attributes = self.gaussians.tensors();
        let [count, _] = attributes.means.dims();
        // The query takes points [N, 4] in [-1, 1]: x, y, z and time. This scene lies within 1.3 units of the origin.
        let space = tanh(attributes.means.clone() / 1.3);
        let time = Tensor::full([count, 1], 2.0 * time - 1.0, &space.device());
        let features = self.hexplane.query(Tensor::cat(vec![space, time], 1));
        attributes.means = attributes.means + self.shift.forward(features);
        attributes
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let options = LoadOptions { random_points: 500, ..LoadOptions::default() };
    let scene = Scene::open(&tiny_scene(folder.path())?, &options)?;
    let store = ImageStore::new(&options, 1 << 26);

    // On a device with autodiff, what the model computes is recorded for the backward pass.
    let device = Device::flex().autodiff();
    device.seed(0);
    let hexplane = HexPlaneConfig { channels: 4, resolution: [16, 16, 16, 8], ..Default::default() }.init(&device);
    let mut model = MovingGaussians {
        gaussians: GaussiansConfig::new().with_sh_degree(0).init(&scene.points, &device),
        shift: LinearConfig::new(hexplane.feature_size(), 3).init(&device),
        hexplane,
    };
    let splatter = Splatter::new(scene.background, 0);
    let mut optimizer = AdamConfig::new().init();
    let mut losses = Vec::new();
    for iteration in 0..120 {
        let frame = &scene.train[iteration * 5 % scene.train.len()];
        let rendering = splatter.render(model.at(frame.time), &frame.camera, None);
        let truth = image_tensor(&*store.get(frame)?, &device);
        let loss = (rendering.image - truth).powi_scalar(2).mean();
        losses.push(loss.clone().into_scalar::<f32>());
        let gradients = GradientsParams::from_grads(loss.backward(), &model);
        model = optimizer.step(1e-2, model, gradients);
    }

    // Every image is used ten times. The error of the last round is a small part of that of the first.
    let round = |k: usize| losses[12 * k..12 * (k + 1)].iter().sum::<f32>() / 12.0;
    println!("squared error: {:.4} in the first round, {:.4} in the last", round(0), round(9));
    assert!(round(9) < 0.5 * round(0), "the model does not learn: {losses:?}");
    // The planes have been trained too: Gaussians move with time.
    let moved = (model.at(0.9).means - model.at(0.1).means).abs().max().into_scalar::<f32>();
    assert!(moved > 0.01, "nothing moves: {moved}");
    Ok(())
}
