//! The TOML configuration of a run: one struct, presets, inheritance, overrides.
//!
//! A configuration is layered. Below everything stand the defaults of the structs in this module; a file or a
//! built-in preset is laid over them, after whatever it `extends`; overrides from the command line come last.
//! Every layer is checked on its own, so that an unknown key or a wrong type is reported with the file, the line and
//! the full key path. `docs/configuration.md` lists every key.
//!
//! ```toml
//! extends = "hexplane-dnerf-cpu"      # a built-in preset, or a path relative to this file
//!
//! [train]
//! fine_iterations = 2000
//! ```

mod attributes;
mod compression;
mod data;
mod device_name;
mod error;
mod eval;
mod layering;
mod model;
mod scaling;
mod train;
mod validate;

#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::LazyLock;

use light4gs_data::DatasetLayout;
use light4gs_keys::Bounds::{Parsed, Whole};
use light4gs_keys::{MOST_INTEGER, keys};
use sha2::{Digest, Sha256};

use layering::{layers, presets};

pub use compression::{
    AttributesConfig, CompressionConfig, ContextTraining, FileProfile, PlaneStepsTraining, RateConfig, RateWeighting,
    ShTraining, WeightsConfig,
};
pub use data::{CamerasKind, DataConfig, TimesKind};
pub use device_name::{Adapter, DEVICES, DeviceName, UnknownDevice};
pub use error::{ConfigError, Origin};
pub use eval::{EvalConfig, EvalSplit};
pub use layering::Overrides;
pub use layering::presets::preset_names;
pub use light4gs_keys::{Bounds, ByName, Key, Problem, UnknownChoice};
pub use model::ModelConfig;
pub use train::{CoarseToFineConfig, LearningRates, TrainConfig};

/// Far longer than any real configuration.
pub const MAX_CONFIG_BYTES: u64 = 1 << 20;

keys! {
    /// The complete configuration of a run.
    pub struct Config {
        /// Seed of everything random in a run: the scattering and the splitting of Gaussians, the order of frames.
        seed: u64 = 0; Whole { least: 0, most: MOST_INTEGER }, "ours";
        /// Back end that computes: `auto` (a graphics card where there is one, otherwise the processor), `ndarray`,
        /// `flex`, or `wgpu`. After `wgpu` an adapter can be named: `wgpu:0` (by number), `wgpu:discrete`,
        /// `wgpu:integrated`, `wgpu:cpu` (software driver).
        device: DeviceName = DeviceName::default();
            Parsed { names: DEVICES, also: "wgpu also with an adapter" }, "ours";
        /// The training data.
        data: DataConfig;
        /// The model.
        model: ModelConfig;
        /// The training.
        train: TrainConfig;
        /// The compression.
        compression: CompressionConfig;
        /// The measurements.
        eval: EvalConfig;
    }
}

/// Every key, in the order of the configuration.
pub static KEYS: LazyLock<Vec<Key>> = LazyLock::new(light4gs_keys::list::<Config>);

/// Every key with its default, as the tables of `docs/configuration.md`.
pub fn keys_as_markdown() -> String {
    light4gs_keys::markdown::<Config>()
}

impl Config {
    /// Reads a TOML file, with everything that it extends, and validates the result.
    ///
    /// # Errors
    /// - [`ConfigError::Read`] for a file that cannot be read, [`ConfigError::Syntax`] for one that is not TOML
    /// - [`ConfigError::UnknownKey`], [`ConfigError::WrongType`], [`ConfigError::Value`] for a key that does not exist, and
    ///   for a value that does not fit
    /// - [`ConfigError::UnknownPreset`], [`ConfigError::Cycle`] for a wrong `extends`
    /// - [`ConfigError::Invalid`] for values out of range
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, ConfigError> {
        layers::resolve(&Origin::File(path.as_ref().to_path_buf()), &[], &[])
    }

    /// The built-in preset called `name` (see [`preset_names`]), validated.
    ///
    /// # Errors
    /// [`ConfigError::UnknownPreset`] with the nearest name.
    pub fn from_preset(name: &str) -> Result<Self, ConfigError> {
        layers::resolve(&Origin::Preset(name.to_owned()), &[], &[])
    }

    /// The preset that fits datasets of a layout, or several joined by `+`, as [`Config::load`] takes them.
    ///
    /// # Errors
    /// [`ConfigError::NoPreset`] for a layout that has none.
    pub fn preset_of(layout: &dyn DatasetLayout) -> Result<&'static str, ConfigError> {
        presets::of_layout(layout.name()).ok_or_else(|| ConfigError::NoPreset { layout: layout.name() })
    }

    /// The configuration for the arguments of a command line: a preset's name or a file's path, and overrides as
    /// [`Overrides::parse`] takes them, such as `train.fine_iterations=200`.
    ///
    /// A name without a folder and without `.toml` is a preset, unless only a file has that name. More presets or files
    /// may follow, each after a `+`, as in `hexplane-dnerf-lego-cpu+medium`: they are laid on top in that order. The path of a
    /// file that exists may itself have a `+` in it.
    ///
    /// # Errors
    /// As [`Config::from_file`] and [`Overrides::parse`]; [`ConfigError::LayerExtends`] if a name after a `+` extends
    /// another configuration.
    pub fn load(name_or_path: &str, overrides: &[String]) -> Result<Self, ConfigError> {
        let mut names = layers::split(name_or_path).into_iter().map(|name| layers::named(name, None));
        let first = names.next().expect("splitting gives at least one part");
        layers::resolve(&first, &names.collect::<Vec<_>>(), overrides)
    }

    /// Reads a configuration from text, for example from a checkpoint. `origin` names it in errors.
    ///
    /// # Errors
    /// As [`Config::from_file`].
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, ConfigError> {
        layers::resolve_text(text, origin)
    }

    /// This configuration with overrides laid over it, validated.
    ///
    /// # Errors
    /// [`ConfigError::Value`] for a value that does not fit into its field, [`ConfigError::Invalid`] for values out of range.
    pub fn with(&self, overrides: &Overrides) -> Result<Self, ConfigError> {
        layers::lay_over(self, overrides)
    }

    /// The whole configuration, every key written out. Reading it back gives an equal configuration.
    ///
    /// # Panics
    /// If an integer is above `i64::MAX`, which TOML cannot hold and [`Config::validate`] refuses.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a validated configuration holds only what TOML can")
    }

    /// SHA-256 of [`Config::to_toml`]: two runs with the same digest were configured alike.
    pub fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.to_toml().as_bytes()).into()
    }

    /// [`Config::digest`] in hexadecimal digits.
    pub fn digest_text(&self) -> String {
        self.digest().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Whether training is the same with both, so that they differ at most in how the result is written.
    pub fn trains_like(&self, other: &Self) -> bool {
        let mut like = self.clone();
        let CompressionConfig { profile, attributes, layers, .. } = other.compression.clone();
        like.compression = CompressionConfig { profile, attributes, layers, ..like.compression };
        like == *other
    }

    /// Checks every range. All problems are reported at once.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] with all of them.
    pub fn validate(&self) -> Result<(), ConfigError> {
        validate::validate(self)
    }
}
