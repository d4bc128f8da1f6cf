//! The learning rate of every parameter group at an iteration.

use std::collections::BTreeMap;

use light4gs_model::{Attribute, LearningRate};

use crate::config::Config;
use crate::optimization::parameters::ParameterGroup;
use crate::optimization::schedule::ExponentialDecay;
use crate::stage::Stage;

/// Learning rates of one iteration, by parameter group.
#[derive(Clone, Debug)]
pub(super) struct GroupRates {
    /// By the paths of their parameters.
    attributes: BTreeMap<String, f64>,
    planes: f64,
    deformation: LearningRate,
    context: f64,
    sh_model: f64,
    steps: f64,
    /// Iterations over which the rates decay.
    steps_of_schedule: usize,
    /// What the cooldown has left of the rates of scene and field.
    cooled: f64,
    iteration: usize,
}

impl GroupRates {
    /// For Gaussians with these attributes. `iteration` counts from 1 in its stage; `extent` is that of the scene,
    /// world units.
    pub(super) fn new<'a>(
        config: &Config,
        attributes: impl Iterator<Item = &'a Attribute>,
        stage: Stage,
        iteration: usize,
        extent: f32,
    ) -> Self {
        let Config { train, compression, .. } = config;
        let rates = &train.learning_rate;
        let steps = rates.schedule_steps.unwrap_or(train.iterations(stage));
        let scale = f64::from(extent);
        let cooled = rates.cooled(train.progress(stage, iteration));
        let decay =
            |first: f64, last: f64| ExponentialDecay::new(first * scale, last * scale, steps).at(iteration as f64);
        let attribute = |attribute: &Attribute| {
            let LearningRate { initial, last } = rates.of(attribute);
            let rate = match attribute.learning_rate.by_extent {
                true => decay(initial, last),
                false => ExponentialDecay::new(initial, last, steps).at(iteration as f64),
            };
            (attribute.path(), rate * cooled)
        };
        let model =
            |first: f64, last: f64| ExponentialDecay::new(first, last, train.fine_iterations).at(iteration as f64);
        Self {
            attributes: attributes.map(attribute).collect(),
            planes: decay(rates.planes_init, rates.planes_final) * cooled,
            deformation: LearningRate {
                initial: rates.deformation_init * scale,
                last: rates.deformation_final * scale,
            },
            steps_of_schedule: steps,
            cooled,
            iteration,
            context: model(compression.context.learning_rate_init, compression.context.learning_rate_final),
            sh_model: model(compression.sh.learning_rate_init, compression.sh.learning_rate_final),
            steps: compression.steps.learning_rate,
        }
    }

    /// The default rate of a deformation field's parameters, from the beginning of the stage to its end.
    pub(super) fn deformation(&self) -> LearningRate {
        self.deformation
    }

    /// The value of another rate at this iteration.
    pub(super) fn at(&self, LearningRate { initial, last }: LearningRate) -> f64 {
        if initial == 0.0 || last == 0.0 {
            return 0.0;
        }
        ExponentialDecay::new(initial, last, self.steps_of_schedule).at(self.iteration as f64) * self.cooled
    }

    /// The rate of a parameter in a group; `None` for an attribute without a known rate.
    pub(super) fn of(&self, group: ParameterGroup, path: &str) -> Option<f64> {
        match group {
            ParameterGroup::Attribute => self.attributes.get(path).copied(),
            ParameterGroup::Planes => Some(self.planes),
            ParameterGroup::Deformation => Some(self.at(self.deformation)),
            ParameterGroup::Context => Some(self.context),
            ParameterGroup::ShModel => Some(self.sh_model),
            ParameterGroup::Steps => Some(self.steps),
        }
    }
}
