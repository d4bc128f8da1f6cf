//! The keys of the configuration that concern the attributes of the Gaussians. The table of attributes names the key of
//! each attribute.

use light4gs_codec::attributes::AttributeSteps;
use light4gs_model::Attribute;
use light4gs_model::attributes::{Coding, Setting};

use super::{AttributesConfig, LearningRates};

/// The learning rate of an attribute over a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AttributeRate {
    /// Its key in the configuration, with the value; none where no key sets the rate.
    pub(crate) key: Option<(&'static str, f64)>,
    /// At the first step.
    pub(crate) first: f64,
    /// At the end of the schedule.
    pub(crate) last: f64,
    /// Whether it is multiplied by the scene's extent.
    pub(crate) by_extent: bool,
}

impl AttributeRate {
    /// None where the attribute's key is not one of `train.learning_rate`.
    pub(crate) fn of(attribute: &Attribute, rates: &LearningRates) -> Option<Self> {
        let constant =
            |key, first: f64| Self { key, first, last: first * rates.attributes_final_share, by_extent: false };
        let keyed = |key, value| Some(constant(Some((key, value)), value));
        match attribute.learning_rate {
            Setting::Number(rate) => Some(constant(None, rate)),
            Setting::Key("means") => Some(Self {
                key: Some(("train.learning_rate.means_init", rates.means_init)),
                first: rates.means_init,
                last: rates.means_final,
                by_extent: true,
            }),
            Setting::Key("scale") => keyed("train.learning_rate.scale", rates.scale),
            Setting::Key("rotation") => keyed("train.learning_rate.rotation", rates.rotation),
            Setting::Key("opacity") => keyed("train.learning_rate.opacity", rates.opacity),
            Setting::Key("sh_dc") => keyed("train.learning_rate.sh_dc", rates.sh_dc),
            Setting::Key("sh_rest") => {
                let key = Some(("train.learning_rate.sh_dc", rates.sh_dc));
                Some(constant(key, rates.sh_dc / rates.sh_rest_divisor))
            }
            Setting::Key(_) => None,
        }
    }
}

impl AttributesConfig {
    /// The quantization steps for Gaussians that have these attributes: from the keys of this table, or from the
    /// attribute itself where it declares a number.
    pub fn steps_of<'a>(&self, attributes: impl Iterator<Item = &'a Attribute>) -> AttributeSteps {
        let configured = self.steps();
        let step = |attribute: &Attribute| match attribute.coding {
            Coding::Quantized(Setting::Number(step)) => Some(step as f32),
            Coding::Quantized(Setting::Key(key)) => configured.of(key),
            Coding::Float32 | Coding::Harmonics => None,
        };
        let steps = attributes.filter_map(|attribute| Some((attribute, step(attribute)?)));
        steps.fold(AttributeSteps::default(), |all, (attribute, step)| all.with(&attribute.name, step))
    }
}

#[cfg(test)]
mod tests {
    use light4gs_model::attributes::BUILT_IN;

    use super::*;

    #[test]
    fn every_key_of_the_table_of_attributes_is_there() {
        for attribute in &BUILT_IN {
            assert!(AttributeRate::of(attribute, &LearningRates::default()).is_some(), "{}", attribute.name);
            if let Coding::Quantized(Setting::Key(key)) = attribute.coding {
                assert!(AttributesConfig::default().steps().of(key).is_some(), "{key}");
            }
        }
    }
}
