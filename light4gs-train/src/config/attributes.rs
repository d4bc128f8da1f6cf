//! Keys with a number for each attribute of the Gaussians, by its name. They replace the numbers in the table of
//! attributes.

use light4gs_codec::attributes::AttributeSteps;
use light4gs_keys::{ByName, nearest};
use light4gs_model::attributes::{BUILT_IN, Coding};
use light4gs_model::{Attribute, LearningRate};

use super::{AttributesConfig, Config, ConfigError, LearningRates, Problem};

/// The numbers that the built-in rows have.
pub(super) fn built_in(number: impl Fn(&Attribute) -> Option<f64>) -> ByName {
    BUILT_IN.iter().filter_map(|attribute| Some((attribute.name.as_ref(), number(attribute)?))).collect()
}

/// The step in an attribute's row.
pub(super) fn step_of(attribute: &Attribute) -> Option<f64> {
    match attribute.coding {
        Coding::Quantized(step) => Some(step),
        Coding::Float32 | Coding::Harmonics => None,
    }
}

impl LearningRates {
    /// The learning rate of an attribute over a stage, before it is multiplied by an extent.
    pub fn of(&self, attribute: &Attribute) -> LearningRate {
        let row = attribute.learning_rate;
        let initial = self.attributes_init.of(&attribute.name).unwrap_or(row.initial);
        let last = self.attributes_final.of(&attribute.name).or(row.last).unwrap_or(initial);
        LearningRate { initial, last }
    }
}

impl AttributesConfig {
    /// The quantization step of an attribute; none where a file has it as float32, or in a section of its own.
    pub fn step(&self, attribute: &Attribute) -> Option<f32> {
        let own = self.steps.of(&attribute.name).filter(|_| attribute.coding != Coding::Harmonics);
        own.or_else(|| step_of(attribute)).map(|step| step as f32)
    }

    /// The quantization steps of Gaussians that have these attributes.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] for a step of another attribute.
    pub fn steps_of<'a>(
        &self,
        attributes: impl Iterator<Item = &'a Attribute> + Clone,
    ) -> Result<AttributeSteps, ConfigError> {
        refuse(self.unknown(attributes.clone()))?;
        let steps = attributes.filter_map(|attribute| Some((attribute, self.step(attribute)?)));
        Ok(steps.fold(AttributeSteps::default(), |all, (attribute, step)| all.with(&attribute.name, step)))
    }

    fn unknown<'a>(&self, attributes: impl Iterator<Item = &'a Attribute>) -> Vec<Problem> {
        let with_step = attributes.filter(|attribute| attribute.coding != Coding::Harmonics);
        unknown("compression.attributes.steps", &self.steps, with_step)
    }
}

impl Config {
    /// Refuses numbers for attributes that Gaussians do not have; `attributes` are all that they have.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] with each such name and the nearest one that there is.
    pub fn check_attributes<'a>(
        &self,
        attributes: impl Iterator<Item = &'a Attribute> + Clone,
    ) -> Result<(), ConfigError> {
        let rates = &self.train.learning_rate;
        let mut problems = unknown("train.learning_rate.attributes_init", &rates.attributes_init, attributes.clone());
        problems.extend(unknown("train.learning_rate.attributes_final", &rates.attributes_final, attributes.clone()));
        problems.extend(self.compression.attributes.unknown(attributes));
        refuse(problems)
    }
}

/// The names in a table of numbers, whose key is `table`, that none of the attributes has.
fn unknown<'a>(table: &str, numbers: &ByName, attributes: impl Iterator<Item = &'a Attribute>) -> Vec<Problem> {
    let known: Vec<&str> = attributes.map(|attribute| attribute.name.as_ref()).collect();
    let problem = |name: &str| {
        let nearest = nearest(known.iter().copied(), name)?;
        let message = format!(
            "is set, but no attribute of the Gaussians that could have it is called so; the nearest is `{nearest}`"
        );
        Some(Problem { key: format!("{table}.{name}"), message })
    };
    numbers.iter().filter(|(name, _)| !known.contains(name)).filter_map(|(name, _)| problem(name)).collect()
}

fn refuse(problems: Vec<Problem>) -> Result<(), ConfigError> {
    if problems.is_empty() { Ok(()) } else { Err(ConfigError::Invalid { problems }) }
}

#[cfg(test)]
mod tests {
    use light4gs_model::attributes::{MEANS, OPACITY_LOGITS};

    use super::*;

    fn config(overrides: &[&str]) -> Config {
        Config::load("hexplane-dnerf-cpu", &overrides.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>())
            .unwrap()
    }

    #[test]
    fn rates_and_steps_are_those_of_the_row_or_of_the_configuration() {
        let further = Attribute::new("age", 1).with_learning_rate(0.01).with_step(0.5);
        let plain = config(&[]);
        let rate = |config: &Config, attribute: &Attribute| config.train.learning_rate.of(attribute);
        let constant = |rate: f64| LearningRate { initial: rate, last: rate };
        assert_eq!(rate(&plain, MEANS), LearningRate { initial: 1.6e-4, last: 1.6e-6 });
        assert_eq!(rate(&plain, OPACITY_LOGITS), constant(0.05));
        assert_eq!(rate(&plain, &further), constant(0.01));
        assert_eq!(plain.compression.attributes.step(&further), Some(0.5));
        assert_eq!(plain.compression.attributes.steps_of(BUILT_IN.iter()).unwrap(), AttributeSteps::default());

        let changed = config(&[
            "train.learning_rate.attributes_init.age=1e-3",
            "train.learning_rate.attributes_init.opacity_logits=0.1",
            "train.learning_rate.attributes_final.opacity_logits=0.01",
            "compression.attributes.steps={ age = 2, means = 0.1 }",
        ]);
        assert_eq!(rate(&changed, &further), constant(1e-3));
        assert_eq!(rate(&changed, OPACITY_LOGITS), LearningRate { initial: 0.1, last: 0.01 });
        assert_eq!(rate(&changed, MEANS), rate(&plain, MEANS));
        let steps = changed.compression.attributes.steps_of(BUILT_IN.iter().chain([&further])).unwrap();
        assert_eq!(steps, AttributeSteps::default().with("age", 2.0).with("means", 0.1));
        changed.check_attributes(BUILT_IN.iter().chain([&further])).unwrap();
    }

    #[test]
    fn an_attribute_that_no_gaussian_has_is_named_with_the_nearest() {
        for (set, nearest) in [
            ("train.learning_rate.attributes_init.mean", "means"),
            ("train.learning_rate.attributes_final.opacity", "opacity_logits"),
            ("compression.attributes.steps.sh_rest", "sh_dc"),
        ] {
            let error = config(&[&format!("{set}=0.1")]).check_attributes(BUILT_IN.iter()).unwrap_err().to_string();
            assert!(error.contains(&format!("`{set}`")) && error.contains(&format!("`{nearest}`")), "{error}");
        }
    }
}
