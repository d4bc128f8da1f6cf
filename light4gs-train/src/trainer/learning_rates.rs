//! The learning rate of every parameter group at an iteration.

use light4gs_model::LearningRate;

use crate::config::Config;
use crate::optimization::parameters::ParameterGroup;
use crate::optimization::schedule::ExponentialDecay;
use crate::stage::Stage;

/// Learning rates of one iteration, by parameter group.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupRates {
    means: f64,
    grid: f64,
    deformation: LearningRate,
    sh_dc: f64,
    sh_rest: f64,
    opacity: f64,
    scale: f64,
    rotation: f64,
    context: f64,
    sh_model: f64,
    steps: f64,
    /// Iterations over which rates decay.
    steps_of_schedule: usize,
    iteration: usize,
}

impl GroupRates {
    /// `iteration` counts from 1 in its stage; `extent` is the scene's, world units.
    pub(super) fn new(config: &Config, stage: Stage, iteration: usize, extent: f32) -> Self {
        let Config { train, compression, .. } = config;
        let rates = &train.learning_rate;
        let steps = rates.schedule_steps.unwrap_or(train.iterations(stage));
        let scale = if rates.scale_by_extent { f64::from(extent) } else { 1.0 };
        let decay =
            |first: f64, last: f64| ExponentialDecay::new(first * scale, last * scale, steps).at(iteration as f64);
        let attribute =
            |rate: f64| ExponentialDecay::new(rate, rate * rates.attributes_final_share, steps).at(iteration as f64);
        let model =
            |first: f64, last: f64| ExponentialDecay::new(first, last, train.fine_iterations).at(iteration as f64);
        Self {
            means: decay(rates.means_init, rates.means_final),
            grid: decay(rates.grid_init, rates.grid_final),
            deformation: LearningRate {
                initial: rates.deformation_init * scale,
                last: rates.deformation_final * scale,
            },
            steps_of_schedule: steps,
            iteration,
            sh_dc: attribute(rates.sh_dc),
            sh_rest: attribute(rates.sh_dc / rates.sh_rest_divisor),
            opacity: attribute(rates.opacity),
            scale: attribute(rates.scale),
            rotation: attribute(rates.rotation),
            context: model(compression.context.learning_rate_init, compression.context.learning_rate_final),
            sh_model: model(compression.sh.learning_rate_init, compression.sh.learning_rate_final),
            steps: compression.steps.learning_rate,
        }
    }

    /// From beginning to end of the stage: what a deformation field is trained with unless it says otherwise.
    pub(super) fn deformation(&self) -> LearningRate {
        self.deformation
    }

    /// Another rate at this iteration.
    pub(super) fn at(&self, LearningRate { initial, last }: LearningRate) -> f64 {
        if initial == 0.0 || last == 0.0 {
            return 0.0;
        }
        ExponentialDecay::new(initial, last, self.steps_of_schedule).at(self.iteration as f64)
    }

    /// The rate of a group.
    pub(super) fn of(&self, group: ParameterGroup) -> f64 {
        match group {
            ParameterGroup::Means => self.means,
            ParameterGroup::LogScales => self.scale,
            ParameterGroup::Quats => self.rotation,
            ParameterGroup::Opacity => self.opacity,
            ParameterGroup::ShDc => self.sh_dc,
            ParameterGroup::ShRest => self.sh_rest,
            ParameterGroup::Grid => self.grid,
            ParameterGroup::Deformation => self.at(self.deformation),
            ParameterGroup::Context => self.context,
            ParameterGroup::ShModel => self.sh_model,
            ParameterGroup::Steps => self.steps,
        }
    }
}
