//! `[compression]`: how the scene is compressed (paper III-C to III-E).

use light4gs_codec::attributes::AttributeSteps;
use light4gs_codec::network_weights::WeightPrecision;
use light4gs_codec::{GaussianLayers, Profile, WeightPrecisions};
use light4gs_model::{AdaptiveQuantizationConfig, ContextPart, ShKind};

use crate::keys::Bounds::{self, Flag, Kind, List, Number, Whole, Word};
use crate::keys::{DECIBELS, ITERATION, RATE, STEP, WEIGHT, choice, keys, named};

keys! {
    /// The form of the file, and what is trained to make it small (paper III-C to III-E,
    /// [design](design.md#compression)).
    pub struct CompressionConfig {
        /// `"compact"`: everything is quantized and entropy coded. `"paper"`: planes and spherical harmonics are
        /// coded, all else is float32. `"float32"`: nothing is coded.
        profile: FileProfile = FileProfile::Compact;
            Word(FileProfile::NAMES),
            "ours; paper", "or \"paper\" (other attributes and weights as float32), \"float32\"";
        /// The file has at most so many bytes, and hardly fewer: the weight of the rate follows while training, and at last
        /// the steps of the attributes. 0: lambda and steps alone say how large it becomes.
        target_bytes: usize = 0; Whole { least: 0, most: 1_000_000_000_000 }, "ours", "0 = as many as lambda asks for";
        /// The decoded file has at least this PSNR on the test views (on those of training where there are none), and is hardly
        /// better: as with `target_bytes`, weight and steps follow. 0: no such wish.
        target_db: f64 = 0.0; DECIBELS, "ours", "0 = what lambda gives";
        /// Layers of Gaussians in the file, the most significant ones first: with more than 1 a player shows a coarse scene
        /// after the first few bytes. Each layer has twice as many as the one before. More layers take some percent more
        /// bytes; the profile `float32` has only one.
        layers: usize = GaussianLayers::default().count as usize;
            Whole { least: 1, most: GaussianLayers::MOST as u64 }, "ours", "more = a coarse scene comes first, for slow connections";
        /// The rate in the loss.
        rate: RateConfig;
        /// The context model of the feature planes (MHCM).
        context: ContextConfig;
        /// Quantization steps of the feature planes.
        steps: StepsConfig;
        /// The entropy model of the spherical harmonics.
        sh: ShConfig;
        /// Steps of the other attributes, in the `compact` profile.
        attributes: AttributesConfig;
        /// Precision of network weights, in the `compact` profile.
        weights: WeightsConfig;
    }
}

choice! {
    /// What is entropy coded in a file.
    pub enum FileProfile: "profile" {
        /// Everything.
        Compact = "compact",
        /// Planes and spherical harmonics; the rest is float32, as in the paper.
        Paper = "paper",
        /// Nothing.
        Float32 = "float32",
    }
}

impl FileProfile {
    /// The codec's profile; none where nothing is entropy coded.
    pub fn coded(self) -> Option<Profile> {
        match self {
            Self::Compact => Some(Profile::Compact),
            Self::Paper => Some(Profile::Paper),
            Self::Float32 => None,
        }
    }
}

keys! {
    /// The rate term of the loss.
    pub struct RateConfig {
        /// Weight of the rate in the loss. 0: the scene is trained without it, and the entropy models are fitted to
        /// the finished scene.
        lambda: f64 = 0.0;
            WEIGHT, "ours; the reference's log of *bouncing balls* has 0.001 per symbol", "0 = no rate in the loss";
        /// What lambda weighs: `"megabytes"` (10^6 bytes) of the file, so that one lambda trades bytes for
        /// distortion, or `"per_symbol"`, bits per plane symbol plus bits per symbol of the spherical harmonics.
        weighting: RateWeighting = RateWeighting::Megabytes;
            Word(RateWeighting::NAMES), "ours; paper", "what lambda weighs; or \"per_symbol\", as the paper";
        /// The rate of the planes has a gradient with respect to the planes. Off: their entropy model is trained, but
        /// the planes are not trained for a low rate.
        planes: bool = true;
            Flag, "ours, for the ablation", "false = the rate trains only the planes' entropy model";
        /// The same for the spherical harmonics.
        sh: bool = true; Flag, "ours, for the ablation", "the same for the spherical harmonics";
        /// The other attributes of the Gaussians have noise, a rate and learned steps too, once densification is over.
        /// Spherical harmonics of degree 1 or 2 are among them. Off: the encoder searches for their steps. Only the
        /// `compact` profile quantizes them in the file; the `paper` profile quantizes only the spherical harmonics.
        attributes: bool = false; Flag, "ours, after HAC++", "the same for the other attributes, with a lambda of their own";
        /// What a megabyte of these attributes weighs in the loss.
        attribute_lambda: f64 = 0.03; WEIGHT, "ours", "of loss for a megabyte";
        /// Iterations from one that has the rate in its loss to the next such iteration.
        interval: usize = 3; Whole { least: 1, most: 1000 }, "paper";
        /// Share of the planes, and of the Gaussians, on which the rate is estimated. The estimate is unbiased.
        fraction: f64 = 0.125; Number { least: 1e-6, most: 1.0 }, "ours", "of the planes and the Gaussians";
        /// Iteration of the fine stage from which the planes have quantization noise and the rate is part of the loss.
        /// Spherical harmonics follow when densification is over.
        from: usize = 1000; ITERATION, "reference: 3; SH 2000";
        /// Iteration of the fine stage after which the planes are frozen: they take the values that the file will have,
        /// and only the rest of the scene is trained on. 0: never.
        planes_until: usize = 27_000;
            ITERATION, "ours", "0 = the planes are trained to the last iteration, as in the paper";
    }
}

choice! {
    /// What `compression.rate.lambda` weighs.
    pub enum RateWeighting: "weighting" {
        /// Megabytes (10^6 bytes) in the file.
        Megabytes = "megabytes",
        /// The paper's sum of the bits per plane symbol and the bits per spherical-harmonics symbol.
        PerSymbol = "per_symbol",
    }
}

named! {
    /// A part of the context model: one of [`ContextPart::NAMES`] in TOML. The model crate has the list.
    pub struct ContextPartName(pub ContextPart): "part";
}

const PART: Bounds = Kind { names: ContextPart::NAMES, list: "light4gs-model/src/context/mod.rs" };

keys! {
    /// Parts and sizes of the context model.
    pub struct ContextConfig {
        /// Sizes of the context model's networks: about 6000 weights at 16 channels, or the public code's
        /// (`"reference"`).
        architecture: ContextArchitecture = ContextArchitecture::Compact;
            Word(ContextArchitecture::NAMES), "ours; reference", "or \"reference\", the public code's sizes";
        /// The parts of the context model; the default is the paper's four. The public code also has
        /// `"high_scale_hyperprior"`, which needs `"hyperprior"` and `"inter_scale"`. Without any part, every channel
        /// has one learned distribution.
        parts: Vec<ContextPartName> = ContextPart::PAPER.map(ContextPartName).to_vec();
            List { element: &PART, length: None }, "paper", "the public code also has \"high_scale_hyperprior\"";
        /// Learning rate of the context model at the first step.
        learning_rate_init: f64 = 5e-3; RATE, "ours";
        /// The same at the end of the fine stage.
        learning_rate_final: f64 = 5e-4; RATE, "ours";
        /// Steps that fit entropy models to a scene that was trained without them.
        fit_iterations: usize = 1500; Whole { least: 1, most: 1_000_000 }, "ours";
    }
}

choice! {
    /// Sizes of the context model's networks.
    pub enum ContextArchitecture: "architecture" {
        /// Small networks, for small scenes.
        Compact = "compact",
        /// The public code's sizes.
        Reference = "reference",
    }
}

keys! {
    /// Quantization steps of the planes.
    pub struct StepsConfig {
        /// Quantization step of the space-only planes at the start.
        space_only: f64 = quantization().space_only; STEP, "ours; reference: 0.1, fixed";
        /// The same for the space-time planes.
        space_time: f64 = quantization().space_time; STEP, "ours; reference: 0.1, fixed";
        /// The steps are learned: they become coarser than at the start where that pays, but not finer, which would help
        /// training frames only ([results](results/hexplane.md#learned-quantization-steps)).
        adaptive: bool = true; Flag, "paper; dropped by the reference";
        /// Iteration of the fine stage from which the steps are learned.
        adaptive_from: usize = 15_000; ITERATION, "paper";
        /// Learning rate of the logarithms of these steps, and of those of attributes.
        learning_rate: f64 = 2e-3; RATE, "ours";
        /// For a scene that was trained without a rate, such as an imported one: the encoder searches for the coarsest
        /// steps that cost at most this much PSNR, in dB. 0: the steps are used as they are.
        search_tolerance: f64 = 0.0; DECIBELS, "ours", "dB; 0 = no search, also for a scene trained without a rate";
    }
}

keys! {
    /// The model of the spherical harmonics beyond degree 0.
    pub struct ShConfig {
        /// Entropy model of the spherical harmonics beyond degree 0: `"factorized"`, `"mixture_of_logistics"`,
        /// `"channel_autoregressive"` or `"hexplane_coupled"`. It is trained for degree 3. Scenes of a lower degree have
        /// none. The file in the `compact` profile does without the first two: there neighbors tell more.
        model: ShModel = ShModel(ShKind::Factorized);
            Kind { names: ShKind::NAMES, list: "light4gs-model/src/sh/mod.rs" },
            "paper", "or \"mixture_of_logistics\", \"channel_autoregressive\", \"hexplane_coupled\"";
        /// Quantization step of the spherical harmonics beyond degree 0.
        step: f64 = 0.02; STEP, "paper";
        /// Learning rate of that model, and of the densities of other attributes, at the first step.
        learning_rate_init: f64 = 5e-3; RATE, "ours";
        /// The same at the end of the fine stage.
        learning_rate_final: f64 = 5e-4; RATE, "ours";
        /// As `compression.steps.search_tolerance`, for this step.
        search_tolerance: f64 = 0.0; DECIBELS, "ours";
    }
}

named! {
    /// The entropy model of the spherical harmonics: one of [`ShKind::NAMES`] in TOML. The model crate has the list.
    pub struct ShModel(pub ShKind): "model";
}

keys! {
    /// Quantization of the attributes other than the spherical harmonics beyond degree 0.
    pub struct AttributesConfig {
        /// Step of the positions, as a share of a typical Gaussian's size. This key and the next four apply in the
        /// `compact` profile only. The search starts from them.
        means: f32 = step("means"); STEP, "ours", "of the size of the typical Gaussian";
        /// Step of the scales' logarithms.
        log_scales: f32 = step("log_scales"); STEP, "ours";
        /// Step of the quaternions' components.
        quats: f32 = step("quats"); STEP, "ours";
        /// Step of the opacity logits.
        opacity_logits: f32 = step("opacity_logits"); STEP, "ours";
        /// Step of the constant colors.
        sh_dc: f32 = step("sh_dc"); STEP, "ours";
        /// The encoder searches for the coarsest steps that cost at most this much PSNR on some training views, in dB.
        /// 0: the steps are used as they are.
        search_tolerance: f64 = 0.05; DECIBELS, "ours", "dB of training PSNR";
    }
}

impl AttributesConfig {
    /// The steps in the codec's type, by the names of the attributes. The keys have the same names.
    pub fn steps(&self) -> AttributeSteps {
        let Self { means, log_scales, quats, opacity_logits, sh_dc, search_tolerance: _ } = *self;
        let steps = AttributeSteps::default().with("means", means).with("log_scales", log_scales);
        steps.with("quats", quats).with("opacity_logits", opacity_logits).with("sh_dc", sh_dc)
    }
}

/// The codec's default step of an attribute.
fn step(attribute: &str) -> f32 {
    AttributeSteps::default().of(attribute).unwrap_or(1.0)
}

/// The most bits that a weight may have.
const MOST_WEIGHT_BITS: u8 = 16;
const WEIGHT_BITS: Bounds = Whole { least: 4, most: MOST_WEIGHT_BITS as u64 };

keys! {
    /// Quantization of network weights.
    pub struct WeightsConfig {
        /// Bits per weight of the deformation network.
        deformation_bits: u8 = bits(WeightPrecisions::default().motion); WEIGHT_BITS, "ours";
        /// Bits per weight of the entropy models' networks.
        context_bits: u8 = bits(WeightPrecisions::default().context_model); WEIGHT_BITS, "ours";
    }
}

/// The model crate's defaults for the planes' quantization.
fn quantization() -> AdaptiveQuantizationConfig {
    AdaptiveQuantizationConfig::new()
}

/// A precision in bits, the only form that the configuration has.
fn bits(precision: WeightPrecision) -> u8 {
    match precision {
        WeightPrecision::Bits(bits) => bits,
        // With so many bits nothing that matters is lost.
        WeightPrecision::Step(_) => MOST_WEIGHT_BITS,
    }
}
