//! Signs that a training has failed: numbers that are no longer finite, and renderings no better than an empty image.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::path::PathBuf;

use burn::module::{Module, Param};
use burn::tensor::Tensor;
use light4gs_model::attributes::{MEANS, attribute_of_path};
use light4gs_model::parameters::{ParameterVisitor, visit_parameters};

use crate::config::Config;
use crate::optimization::parameters::{COMPRESSION, ParameterGroup};
use crate::stage::Stage;

/// Numbers of a training that are no longer finite, and how to continue.
#[derive(Clone, Debug, PartialEq)]
pub struct Divergence {
    /// The stage.
    pub stage: Stage,
    /// Its iteration, from 1.
    pub iteration: usize,
    /// The number that is not finite.
    pub found: NotFinite,
    /// The newest checkpoint. A checkpoint with such numbers is never written.
    pub checkpoint: Option<PathBuf>,
    /// Folder of the run, if it has one.
    pub run: Option<PathBuf>,
    /// A key of the configuration to change, and a value for it.
    pub remedy: Remedy,
}

/// A change of the configuration that may help.
#[derive(Clone, Debug, PartialEq)]
pub struct Remedy {
    /// The key.
    pub key: String,
    /// A value for it.
    pub value: f64,
}

impl fmt::Display for Remedy {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // With the digits of a float32: a learning rate needs no more.
        write!(formatter, "{}={:e}", self.key, self.value as f32)
    }
}

/// A number that is not finite.
#[derive(Clone, Debug, PartialEq)]
pub enum NotFinite {
    /// The loss, while all parameters are finite.
    Loss(f32),
    /// A parameter, or a moment of one.
    Parameter {
        /// Its name, as in checkpoints.
        name: String,
        /// Of the flattened tensor.
        index: usize,
        /// NaN or an infinity.
        value: f32,
    },
}

impl std::error::Error for Divergence {}

impl fmt::Display for Divergence {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { stage, iteration, found, checkpoint, run, remedy } = self;
        write!(formatter, "training diverged in the {stage} stage at iteration {iteration}: ")?;
        match found {
            NotFinite::Loss(loss) => write!(formatter, "the loss is {loss}")?,
            NotFinite::Parameter { name, index, value } => {
                write!(formatter, "the parameter `{name}` has {value} at index {index}")?;
            }
        }
        match checkpoint {
            Some(path) => write!(formatter, ". The last good checkpoint is {}; go on from it", path.display())?,
            None => write!(formatter, ". There is no checkpoint yet; begin anew")?,
        }
        match run {
            Some(run) => write!(formatter, " with `light4gs resume {} --set {remedy}`", run.display()),
            None => write!(formatter, " with `{remedy}`"),
        }
    }
}

/// The key of an attribute's learning rate at the first training step.
fn attribute_key(name: &str) -> String {
    format!("train.learning_rate.attributes_init.{name}")
}

/// The learning rates of attributes that the configuration has: their keys and values.
fn attribute_rates(config: &Config) -> impl Iterator<Item = (String, f64)> {
    let rates = &config.train.learning_rate;
    let last = rates.attributes_final.iter();
    let last = last.map(|(name, rate)| (format!("train.learning_rate.attributes_final.{name}"), rate));
    rates.attributes_init.iter().map(|(name, rate)| (attribute_key(name), rate)).chain(last)
}

/// The learning rate of a parameter: its key and its value. `None` for an attribute that the configuration does not name.
fn learning_rate(path: &str, config: &Config) -> Option<(String, f64)> {
    let group = ParameterGroup::of(path)?;
    if group == ParameterGroup::Attribute {
        let name = attribute_of_path(path)?;
        return Some((attribute_key(name), config.train.learning_rate.attributes_init.of(name)?));
    }
    let of_group = group_rates(config).into_iter().find(|(other, ..)| *other == group);
    of_group.map(|(_, key, value)| (key.to_owned(), value))
}

/// The learning rates of all groups except the attributes: their keys and values.
fn group_rates(config: &Config) -> [(ParameterGroup, &'static str, f64); 5] {
    let (rates, compression) = (&config.train.learning_rate, &config.compression);
    let (context, sh) = (&compression.context, &compression.sh);
    [
        (ParameterGroup::Planes, "train.learning_rate.planes_init", rates.planes_init),
        (ParameterGroup::Deformation, "train.learning_rate.deformation_init", rates.deformation_init),
        (ParameterGroup::Context, "compression.context.learning_rate_init", context.learning_rate_init),
        (ParameterGroup::ShModel, "compression.sh.learning_rate_init", sh.learning_rate_init),
        (ParameterGroup::Steps, "compression.steps.learning_rate", compression.steps.learning_rate),
    ]
}

/// What else can make a training diverge: the rates at the end, and the weights of terms of the loss other than the
/// images'.
fn other_keys(config: &Config) -> [(&'static str, f64); 6] {
    let (rates, weights) = (&config.train.learning_rate, &config.train.regularizer);
    [
        ("train.learning_rate.planes_final", rates.planes_final),
        ("train.learning_rate.deformation_final", rates.deformation_final),
        ("train.regularizer.plane_smoothness", weights.plane_smoothness.into()),
        ("train.regularizer.time_smoothness", weights.time_smoothness.into()),
        ("train.regularizer.time_l1", weights.time_l1.into()),
        ("compression.rate.lambda", config.compression.rate.lambda),
    ]
}

/// A key this many times above its default is taken for the cause before any other. Presets stay below.
const SUSPICIOUS: f64 = 12.0;

/// Of the learning rates and the weights of the loss, the one that is furthest above its default, with that default.
/// `None` if all are near their defaults.
pub(super) fn unusual_key(config: &Config) -> Option<Remedy> {
    let keys = |config: &Config| -> Vec<(String, f64)> {
        let groups = group_rates(config).map(|(_, key, value)| (key, value));
        let others = groups.into_iter().chain(other_keys(config)).map(|(key, value)| (key.to_owned(), value));
        attribute_rates(config).chain(others).collect()
    };
    let usual: BTreeMap<String, f64> = keys(&Config::default()).into_iter().collect();
    let ratio = |(key, value): (String, f64)| {
        let usual = *usual.get(&key)?;
        // In place of a default of 0, a small weight.
        let ratio = value / if usual > 0.0 { usual } else { 0.1 };
        Some((Remedy { key, value: usual }, ratio))
    };
    let (remedy, ratio) = keys(config).into_iter().filter_map(ratio).max_by(|a, b| a.1.total_cmp(&b.1))?;
    (ratio > SUSPICIOUS).then_some(remedy)
}

/// A change that may keep the training from diverging again: an unusual key, or else the learning rate of the parameter
/// that is not finite.
pub(crate) fn remedy(found: &NotFinite, config: &Config) -> Remedy {
    if let Some(remedy) = unusual_key(config) {
        return remedy;
    }
    let rate = match found {
        NotFinite::Parameter { name, .. } => learning_rate(path_of(name), config),
        NotFinite::Loss(_) => None,
    };
    let means = || (attribute_key(&MEANS.name), config.train.learning_rate.of(MEANS).initial);
    let (key, value) = rate.unwrap_or_else(means);
    Remedy { key, value: value / 10.0 }
}

/// The path of the parameter that a tensor of a checkpoint holds, or whose moment it holds.
fn path_of(name: &str) -> &str {
    ["scene.", "first.", "second."].iter().find_map(|prefix| name.strip_prefix(prefix)).unwrap_or(name)
}

/// The first parameter of a module that has a number which is not finite. `prefix` is put before its name.
pub(crate) fn not_finite_parameter<M: Module>(module: &M, prefix: &str) -> Option<NotFinite> {
    let mut sums = Sums::default();
    visit_parameters(module, &mut sums);
    if sums.0.is_empty() {
        return None;
    }
    // If all is well, only one number is read back from the device.
    let sum: f32 = Tensor::cat(sums.0, 0).sum().into_scalar();
    if sum.is_finite() {
        return None;
    }
    // The sum of finite numbers can be infinite too.
    let mut search = Search { prefix, found: None };
    visit_parameters(module, &mut search);
    search.found
}

/// The same for a scene and its entropy models.
pub(crate) fn not_finite_in<S: Module, C: Module>(scene: &S, compression: Option<&C>) -> Option<NotFinite> {
    not_finite_parameter(scene, "scene")
        .or_else(|| compression.and_then(|models| not_finite_parameter(models, COMPRESSION)))
}

/// The sum of every parameter, `[1]` each.
#[derive(Default)]
struct Sums(Vec<Tensor<1>>);

fn off_the_tape<const D: usize>(parameter: &Param<Tensor<D>>) -> Tensor<D> {
    let value = parameter.val();
    if value.device().is_autodiff() { value.inner() } else { value }
}

impl ParameterVisitor for Sums {
    fn visit<const D: usize>(&mut self, _: &str, parameter: &Param<Tensor<D>>) {
        if parameter.val().shape().num_elements() > 0 {
            self.0.push(off_the_tape(parameter).sum());
        }
    }
}

struct Search<'a> {
    prefix: &'a str,
    found: Option<NotFinite>,
}

impl ParameterVisitor for Search<'_> {
    fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>) {
        if self.found.is_some() {
            return;
        }
        let values = off_the_tape(parameter).into_data();
        let bad = values.iter::<f32>().enumerate().find(|(_, value)| !value.is_finite());
        self.found =
            bad.map(|(index, value)| NotFinite::Parameter { name: format!("{}.{path}", self.prefix), index, value });
    }
}

/// Logged images over which renderings are compared with an empty image.
const WINDOW: usize = 10;

/// Detects renderings that are no better than an image of the background alone.
#[derive(Debug, Default)]
pub(super) struct EmptyImageWatch {
    /// Mean squared errors of the rendering and of the empty image, the newest last.
    window: VecDeque<[f64; 2]>,
    /// Whether the whole window has been better than empty images.
    was_better: bool,
    told: bool,
}

impl EmptyImageWatch {
    /// Takes the PSNR of a rendering and of the empty image, both against the training image, when an image is logged.
    /// Returns a warning if renderings have become empty images, or if a stage ends with such.
    pub(super) fn log(&mut self, psnr: f64, empty_psnr: f64, stage_ends: bool, training_ends: bool) -> Option<String> {
        if self.window.len() == WINDOW {
            self.window.pop_front();
        }
        self.window.push_back([psnr, empty_psnr].map(|psnr| 10f64.powf(-psnr / 10.0)));
        let [error, empty] = [0, 1].map(|i| self.window.iter().map(|pair| pair[i]).sum::<f64>());
        let is_empty = error >= empty || error.is_nan();
        let full = self.window.len() == WINDOW;
        self.was_better |= full && !is_empty;
        self.told &= is_empty;
        let due = is_empty && !self.told && ((full && self.was_better) || training_ends || (full && stage_ends));
        if !due {
            return None;
        }
        self.told = true;
        let count = self.window.len() as f64;
        let [psnr, empty] = [error, empty].map(|sum| -10.0 * (sum / count).log10());
        Some(format!(
            "training PSNR is {psnr:.2} dB, and an empty image of the background alone has {empty:.2} dB: nothing is learned"
        ))
    }

    /// Starts again, for another stage.
    pub(super) fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};
    use light4gs_data::PointCloud;

    use super::*;

    #[test]
    fn a_parameter_that_is_not_finite_is_named() {
        let device = Device::flex().autodiff();
        let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.5, 2.0]], colors: vec![[0.5; 3]; 2] };
        let mut config = Config::default();
        config.model.fields.hexplane.hexplane.channels = 2;
        config.model.fields.hexplane.hexplane.resolution = [8, 8, 8, 4];
        let mut scene = config.model.build().init(&cloud, &device);
        assert_eq!(not_finite_parameter(&scene, "scene"), None);
        let with = |value: f32| {
            Tensor::<2>::from_data(TensorData::new(vec![0.0, value, 0.0, f32::MAX, 0.0, f32::MAX], [2, 3]), &device)
        };
        // The sum is infinite, but each number is finite.
        scene.gaussians.means = Param::from_tensor(with(1.0));
        assert_eq!(not_finite_parameter(&scene, "scene"), None);
        scene.gaussians.means = Param::from_tensor(with(f32::INFINITY));
        let found = not_finite_parameter(&scene, "scene").unwrap();
        let name = "scene.gaussians.means".to_owned();
        assert_eq!(found, NotFinite::Parameter { name, index: 1, value: f32::INFINITY });
        assert_eq!(remedy(&found, &config).to_string(), "train.learning_rate.attributes_init.means=1.6e-5");
        config.train.learning_rate.attributes_init.set("opacity_logits", 5.0);
        assert_eq!(remedy(&found, &config).to_string(), "train.learning_rate.attributes_init.opacity_logits=5e-2");
    }

    #[test]
    fn presets_are_not_suspicious() {
        for name in crate::config::preset_names() {
            assert_eq!(unusual_key(&Config::from_preset(name).unwrap()), None, "{name}");
        }
    }

    #[test]
    fn renderings_that_fall_to_empty_images_are_noticed_once() {
        let mut watch = EmptyImageWatch::default();
        // The first images are worse than empty ones; that needs no warning.
        assert!((0..5).all(|_| watch.log(8.0, 12.0, false, false).is_none()));
        assert!((0..30).all(|_| watch.log(20.0, 12.0, false, false).is_none()));
        let told: Vec<_> = (0..40).filter_map(|_| watch.log(12.0, 12.0, false, false)).collect();
        assert_eq!(told.len(), 1, "{told:?}");
        watch.reset();
        assert!((0..30).all(|_| watch.log(8.0, 12.0, false, false).is_none()));
        assert!(watch.log(8.0, 12.0, true, true).unwrap().contains("8.00 dB"));
    }
}
