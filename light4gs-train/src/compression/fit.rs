//! Fitting entropy models to a scene that was trained without them. The planes do not change.

use burn::tensor::Device;
use light4gs_model::{DeformationField, DynamicScene};
use rand::Rng;

use super::encoder::is_superseded;
use super::{Compression, CompressionOf, EntropyModels};
use crate::config::{Config, FileProfile};
use crate::divergence::Divergence;
use crate::divergence::{not_finite_parameter, remedy};
use crate::error::TrainError;
use crate::optimization::adam::Adam;
use crate::optimization::gradients::GradientSums;
use crate::optimization::parameters::{COMPRESSION, ParameterGroup};
use crate::optimization::schedule::ExponentialDecay;
use crate::randomness::{Purpose, generator, seed_device};
use crate::stage::Stage;

/// Trains new models on a frozen scene for `compression.context.fit_iterations` steps. After each step `progress` is
/// called with the number of iterations done and their total.
///
/// # Errors
/// What `progress` returns; [`TrainError::Diverged`] if a model has numbers that are not finite.
pub fn fit<F: DeformationField, E: EntropyModels>(
    models: &E,
    scene: &DynamicScene<F>,
    config: &Config,
    device: &Device,
    progress: &mut dyn FnMut(usize, usize) -> Result<(), TrainError>,
) -> Result<CompressionOf<E>, TrainError> {
    seed_device(device, config.seed, Purpose::Rate, Stage::Fine, 0);
    let mut compression = Compression::new(models, config, scene.planes(), device)?;
    let settings = &config.compression;
    let iterations = settings.context.fit_iterations;
    let decay = |first: f64, last: f64| ExponentialDecay::new(first, last, iterations);
    let context = decay(settings.context.learning_rate_init, settings.context.learning_rate_final);
    let sh = decay(settings.sh.learning_rate_init, settings.sh.learning_rate_final);
    compression.start_from(scene.planes());
    let superseded = settings.profile == FileProfile::Compact && compression.sh.as_ref().is_some_and(is_superseded);
    if compression.planes.is_none() && (compression.sh.is_none() || superseded) {
        // Nothing is coded with a model.
        return Ok(compression);
    }
    let mut adam = Adam::default();
    for iteration in 1..=iterations {
        seed_device(device, config.seed, Purpose::Rate, Stage::Fine, iteration);
        let mut random = generator(config.seed, Purpose::Rate, Stage::Fine, iteration);
        let noisy = compression.noisy(
            scene,
            false,
            true,
            generator(config.seed, Purpose::Noise, Stage::Fine, iteration).random(),
        );
        let rate = compression.rate(&noisy, settings.rate.fraction, true, None, 0.0, &mut random);
        let mut gradients = GradientSums::default();
        let Some(rate) = rate.megabytes() else { break };
        gradients.add_module(&compression, &mut rate.backward());
        // The steps do not change: there is no distortion here against which their rate could be weighed.
        adam.step_modules(&mut [(COMPRESSION, &mut compression)], &mut gradients, |group, _| match group {
            ParameterGroup::Context => Some(context.at(iteration as f64)),
            ParameterGroup::ShModel => Some(sh.at(iteration as f64)),
            _ => None,
        });
        progress(iteration, iterations)?;
    }
    match not_finite_parameter(&compression, COMPRESSION) {
        None => Ok(compression),
        Some(found) => Err(TrainError::Diverged(Box::new(Divergence {
            stage: Stage::Fine,
            iteration: iterations,
            remedy: remedy(&found, config),
            found,
            checkpoint: None,
            run: None,
        }))),
    }
}
