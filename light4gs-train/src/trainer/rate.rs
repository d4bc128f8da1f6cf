//! Quantisation noise and the rate in a training step (paper III-C to III-E, IV-B).

use burn::tensor::Tensor;

use super::Trainer;
use crate::compression::{NoisyScene, settled_planes};
use crate::config::Config;
use crate::error::TrainError;
use crate::metrics_log::Stage;
use crate::randomness::{Purpose, generator, seed_device};

impl Trainer {
    /// The scene as it will roughly be decoded, once the rate has entered the training.
    pub(super) fn quantization_noise(
        &mut self,
        stage: Stage,
        iteration: usize,
    ) -> Result<Option<NoisyScene>, TrainError> {
        let Config { seed, compression: config, .. } = &self.config;
        let from = config.rate.from.max(1);
        if stage == Stage::Coarse || iteration < from {
            return Ok(None);
        }
        let with_sh = self.sh_counts(iteration);
        let settled = self.planes_are_settled(stage, iteration);
        let Some(compression) = self.state.compression.as_mut() else { return Ok(None) };
        let scene = &mut self.state.scene;
        if iteration == from {
            compression
                .context
                .start_from(&scene.hexplane.tensors(), &compression.quantization.steps_without_gradient());
        }
        if settled && iteration == config.rate.planes_until + 1 {
            scene.hexplane = settled_planes(scene, compression, config, &self.device)?;
        }
        seed_device(&self.device, *seed, stage, iteration);
        let learn_steps = config.steps.adaptive && iteration >= config.steps.adaptive_from;
        Ok(Some(match settled {
            true => compression.noisy_beside_settled_planes(scene, with_sh),
            false => compression.noisy(scene, learn_steps, with_sh),
        }))
    }

    /// Whether the planes have the values that the file will have: nothing changes them, nor what codes them, any more.
    pub(super) fn planes_are_settled(&self, stage: Stage, iteration: usize) -> bool {
        let until = self.config.compression.rate.planes_until;
        stage == Stage::Fine && until > 0 && iteration > until && self.state.compression.is_some()
    }

    /// Whether spherical harmonics have a part in the rate: once Gaussians neither come nor split any more.
    fn sh_counts(&self, iteration: usize) -> bool {
        iteration > self.config.train.densify.until
    }

    /// The weighted rate, in the iterations in which it is due.
    pub(super) fn rate_term(&self, noisy: &NoisyScene, iteration: usize) -> Option<Tensor<1>> {
        let config = &self.config.compression.rate;
        let compression = self.state.compression.as_ref().filter(|_| iteration.is_multiple_of(config.interval))?;
        let mut generator = generator(self.config.seed, Purpose::Rate, Stage::Fine, iteration);
        let with_sh = self.sh_counts(iteration);
        let rate = compression.rate(noisy, &self.state.scene, config.fraction, with_sh, &mut generator);
        Some(match config.weighting.as_str() {
            "per_symbol" => rate.bits_per_symbol() * config.lambda,
            // Once in `interval` iterations, so that many times as much: lambda does not depend on the interval.
            _ => rate.megabytes() * (config.lambda * config.interval as f64),
        })
    }
}
