//! Entropy models for a scene that was trained without them: the planes stay as they are.

use burn::module::Param;
use burn::tensor::{Device, Gradients, Tensor};
use light4gs_model::DynamicScene;

use super::Compression;
use crate::config::Config;
use crate::error::TrainError;
use crate::optimization::adam::Adam;
use crate::optimization::parameters::{ParameterGroup, ParameterVisitor, visit_compression};
use crate::optimization::schedule::ExponentialDecay;
use crate::randomness::{Purpose, generator, seed_device};
use crate::stage::Stage;

/// Trains fresh models on a frozen scene for `compression.context.fit_iterations` steps; `progress` is told the iterations
/// done, and those that there are, after each.
///
/// # Errors
/// What `progress` returns.
pub fn fit(
    scene: &DynamicScene,
    config: &Config,
    device: &Device,
    progress: &mut dyn FnMut(usize, usize) -> Result<(), TrainError>,
) -> Result<Compression, TrainError> {
    seed_device(device, config.seed, Stage::Fine, 0);
    let mut compression = Compression::new(config, device);
    let settings = &config.compression;
    let iterations = settings.context.fit_iterations;
    let decay = |first: f64, last: f64| ExponentialDecay::new(first, last, iterations);
    let context = decay(settings.context.learning_rate_init, settings.context.learning_rate_final);
    let sh = decay(settings.sh.learning_rate_init, settings.sh.learning_rate_final);
    compression.context.start_from(&scene.field.hexplane.tensors(), &compression.quantization.steps_without_gradient());
    let mut adam = Adam::default();
    for iteration in 1..=iterations {
        seed_device(device, config.seed, Stage::Fine, iteration);
        let mut random = generator(config.seed, Purpose::Rate, Stage::Fine, iteration);
        let noisy = compression.noisy(scene, false, true);
        let rate = compression.rate(&noisy, settings.rate.fraction, true, &mut random);
        let mut gradients = rate.megabytes().backward();
        let mut step = FitStep {
            adam: &mut adam,
            gradients: &mut gradients,
            context: context.at(iteration as f64),
            sh: sh.at(iteration as f64),
        };
        visit_compression(&mut compression, &mut step);
        progress(iteration, iterations)?;
    }
    Ok(compression)
}

struct FitStep<'a> {
    adam: &'a mut Adam,
    gradients: &'a mut Gradients,
    context: f64,
    sh: f64,
}

impl ParameterVisitor for FitStep<'_> {
    fn visit<const D: usize>(&mut self, group: ParameterGroup, name: &str, parameter: &mut Param<Tensor<D>>) {
        let rate = match group {
            ParameterGroup::Context => self.context,
            ParameterGroup::ShModel => self.sh,
            _ => return,
        };
        if let Some(gradient) = parameter.val().grad_remove(self.gradients) {
            self.adam.step(name, parameter, gradient, rate);
        }
    }
}
