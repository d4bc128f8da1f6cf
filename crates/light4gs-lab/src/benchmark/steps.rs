//! Timing of whole training steps, each of one view, and of rendering, with the field and the rate of a preset.

use std::collections::BTreeMap;
use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_data::PointCloud;
use light4gs_model::{DeformationField, DynamicScene, FinePosition, GaussianTensors, SceneAtRest, Splatter};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{BenchScene, Cost, Meter, WARM_UP, median_of};
use crate::compression::{Compression, ConfiguredModels};
use crate::config::Config;
use crate::density::GaussianEditor;
use crate::metrics::l1;
use crate::optimization::adam::Adam;
use crate::optimization::gradients::GradientSums;

/// The time at which views are rendered.
const TIME: f32 = 0.3;
/// What a megabyte weighs in the loss.
const LAMBDA: f64 = 0.05;

/// The rows of a preset in the table.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepNames {
    pub(super) adam: &'static str,
    pub(super) plain: &'static str,
    pub(super) noise: &'static str,
    pub(super) rate: &'static str,
    pub(super) render: &'static str,
}

pub(super) const HEXPLANE: StepNames = StepNames {
    adam: "hexplane, Adam step",
    plain: "hexplane, training step",
    noise: "hexplane, step with noise",
    rate: "hexplane, step with noise and rate",
    render: "hexplane, render",
};

pub(super) const NODES: StepNames = StepNames {
    adam: "nodes, Adam step",
    plain: "nodes, training step",
    noise: "nodes, step with noise",
    rate: "nodes, step with noise and rate",
    render: "nodes, render",
};

/// Times the steps of a preset on a scene's Gaussians.
pub(super) fn timings(
    scene: &BenchScene,
    config: &Config,
    names: &StepNames,
    meter: &Meter,
    add: &mut impl FnMut(&'static str, Cost),
) {
    let Meter { device, repeats, launches } = *meter;
    let autodiff = &device.clone().autodiff();
    let splatter = Splatter::new(scene.background, config.model.sh_degree.into());
    let [height, width] = [scene.camera.height as usize, scene.camera.width as usize];
    let truth = Tensor::<3>::zeros([height, width, 3], autodiff);
    let position = FinePosition {
        iteration: 1,
        iterations: 2,
        times: 100,
        window: [0.0, 1.0],
        window_before: [0.0, 1.0],
        seed: 0,
    };
    let mut dynamic = dynamic(scene, config, &position, autodiff);
    let regularizer = config.train.regularizer.build();
    // As a trainer, which knows from the step before.
    let seen = splatter.render(dynamic.at(TIME), &scene.camera, None).intersections.into_scalar::<i64>();
    let trained = splatter.with_room_for(2 * seen as usize);
    let loss_of = |model: &DynamicScene, frame: usize| {
        let image = trained.render(model.at(TIME), &scene.camera_at(frame), None).image;
        let loss = l1(image, truth.clone());
        let loss = match model.planes() {
            Some(planes) => loss + regularizer.loss(planes),
            None => loss,
        };
        match model.field.regularizer(&at_rest(model), &position) {
            Some(own) => loss + own,
            None => loss,
        }
    };
    let mut adam = Adam::default();
    // Rates so small that the scene does not change while it is timed.
    let mut update = |dynamic: &mut DynamicScene, mut gradients: GradientSums| {
        adam.step_module("", dynamic, &mut gradients, |_, _| Some(1e-12));
    };
    let mut times = [Vec::new(), Vec::new()];
    let mut counts = [BTreeMap::new(), BTreeMap::new()];
    for repetition in 0..WARM_UP + repeats {
        launches.take();
        let begin = Instant::now();
        let mut tape = loss_of(&dynamic, repetition).backward();
        let mut gradients = GradientSums::default();
        gradients.add_module(&dynamic, &mut tape);
        let _ = device.sync();
        let of_gradients = launches.take();
        let middle = Instant::now();
        update(&mut dynamic, gradients);
        let _ = device.sync();
        counts = [launches.take(), of_gradients];
        if repetition >= WARM_UP {
            times[0].push(middle.elapsed().as_secs_f64() * 1e3);
            times[1].push(begin.elapsed().as_secs_f64() * 1e3);
        }
    }
    let [adam_ms, step_ms] = times.map(median_of);
    let [of_adam, of_gradients] = counts;
    let mut of_step = of_adam.clone();
    of_gradients.into_iter().for_each(|(kernel, count)| *of_step.entry(kernel).or_default() += count);
    add(names.adam, Cost { milliseconds: adam_ms, launches: of_adam });
    add(names.plain, Cost { milliseconds: step_ms, launches: of_step });

    let mut config = config.clone();
    config.compression.rate.lambda = LAMBDA;
    let compression = Compression::of_run(&ConfiguredModels, &config, &dynamic, autodiff);
    let mut compression = compression.expect("the preset's models fit its field").expect("it has a rate");
    compression.start_attributes_from(&dynamic.gaussians);
    for (name, with_rate) in [(names.noise, false), (names.rate, true)] {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let step = meter.measure(
            || (),
            |()| {
                let noisy = compression.noisy(&dynamic, true, true, 0);
                let mut sums = GradientSums::default();
                let image = trained.render(noisy.scene.at(TIME), &scene.camera, None).image;
                sums.add_module(&noisy.scene, &mut l1(image, truth.clone()).backward());
                if with_rate {
                    let rate = compression.rate(&noisy, config.compression.rate.fraction, true, None, &mut random);
                    let attributes = rate.attribute_megabytes();
                    let term = attributes.into_iter().fold(rate.megabytes(), |sum, part| sum + part) * LAMBDA;
                    sums.add_module(&noisy.scene, &mut term.backward());
                }
                update(&mut dynamic, sums);
            },
        );
        add(name, step);
    }

    let decoded = dynamic.valid();
    let mut frame = 0;
    let render = meter.measure(
        || (),
        |()| {
            frame += 1;
            splatter.render(decoded.at(TIME), &scene.camera_at(frame), None).image
        },
    );
    add(names.render, render);
}

/// A dynamic scene over the scene's Gaussians, with the field and the degree of a preset, and with motion begun.
fn dynamic(scene: &BenchScene, config: &Config, position: &FinePosition, device: &Device) -> DynamicScene {
    let positions = scene.means.as_chunks::<3>().0.to_vec();
    let colors = vec![[0.5; 3]; positions.len()];
    let mut dynamic = config.model.build().init(&PointCloud { positions, colors }, device);
    let gaussians = scene.gaussians(&device.clone().inner()).tensors();
    GaussianEditor::new(&mut dynamic.gaussians, &mut Adam::default()).update(|own| {
        let sh_rest = gaussians.sh_rest.narrow(1, 0, own.sh_rest.dims()[1]);
        GaussianTensors { sh_rest, further: own.further, ..gaussians }
    });
    let begin = FinePosition { iteration: 0, ..*position };
    let DynamicScene { gaussians, coordinates, field, .. } = &mut dynamic;
    field.begin_motion(&SceneAtRest { gaussians, coordinates, extent: 1.0 }, &begin);
    dynamic
}

fn at_rest(model: &DynamicScene) -> SceneAtRest<'_> {
    SceneAtRest { gaussians: &model.gaussians, coordinates: &model.coordinates, extent: 1.0 }
}
