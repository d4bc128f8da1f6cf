//! `[compression]`: how the scene is compressed (paper III-C to III-E).

use light4gs_codec::network_weights::WeightPrecision;
use light4gs_codec::{GaussianLayers, Profile, WeightPrecisions};
use light4gs_keys::Bounds::{self, Flag, Number, Whole};
use light4gs_keys::{ByName, DECIBELS, ITERATION, RATE, WEIGHT, choice, keys};
use light4gs_model::{AdaptiveQuantizationConfig, ContextConfig, QUANTIZATION_STEP, ShConfig};

use super::attributes::{built_in, step_of};

keys! {
    /// The form of the file, and what is trained to make it small (paper III-C to III-E,
    /// [design](design.md#compression)).
    pub struct CompressionConfig {
        /// The parts of the file that are quantized and entropy coded.
        profile: FileProfile = FileProfile::Compact;
            FileProfile::BOUNDS,
            "ours; paper";
        /// Upper bound of the file's size in bytes. To come close to this bound, training adapts the weight of the
        /// rate, and the encoder adapts the steps of the attributes. 0 means no bound; then the size follows from
        /// lambda and the quantization steps.
        target_bytes: usize = 0; Whole { least: 0, most: 1_000_000_000_000 }, "ours";
        /// Lower bound of the PSNR of the decoded file on the test views (on the training views if there are none), in
        /// dB. The PSNR comes close to this bound, since the weight of the rate and the quantization steps are adapted
        /// as with `target_bytes`. 0 means no bound.
        target_db: f64 = 0.0; DECIBELS, "ours";
        /// Number of layers of Gaussians in the file, the most significant Gaussians first. With more than 1 layer, a
        /// player shows a coarse scene after the first few bytes. Each layer has twice as many Gaussians as the layer
        /// before. More layers take some percent more bytes. A file of the profile `float32` has only one layer.
        layers: usize = GaussianLayers::default().count as usize;
            Whole { least: 1, most: GaussianLayers::MOST as u64 }, "ours";
        /// The rate in the loss.
        rate: RateConfig;
        /// The context model of the feature planes (MHCM).
        context: ContextTraining;
        /// Quantization steps of the feature planes.
        steps: PlaneStepsTraining;
        /// The entropy model of the spherical harmonics.
        sh: ShTraining;
        /// Steps of the other attributes, in the `compact` profile.
        attributes: AttributesConfig;
        /// Precision of network weights, in the `compact` profile.
        weights: WeightsConfig;
    }
}

choice! {
    /// The parts of a file that are entropy coded.
    pub enum FileProfile: "profile" {
        /// Everything is coded.
        Compact = "compact",
        /// Planes and spherical harmonics are coded; the rest is float32, as in the paper.
        Paper = "paper",
        /// Nothing is coded.
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
        /// Weight of the rate in the loss. With 0, the scene is trained without the rate, and the entropy models are
        /// fitted to the finished scene.
        lambda: f64 = 0.0;
            WEIGHT, "ours; the reference's log of *bouncing balls* has 0.001 per symbol";
        /// The unit of the rate that lambda multiplies.
        weighting: RateWeighting = RateWeighting::Megabytes;
            RateWeighting::BOUNDS, "ours; paper";
        /// Whether the rate of the planes has a gradient with respect to the planes. If off, the entropy model of the
        /// planes is trained, but the planes are not trained for a low rate.
        planes: bool = true;
            Flag, "ours, for the ablation";
        /// Whether the rate of the spherical harmonics has a gradient with respect to the harmonics. If off, the
        /// entropy model of the harmonics is trained, but the harmonics are not trained for a low rate.
        sh: bool = true; Flag, "ours, for the ablation";
        /// Whether the attributes without an entropy model of their own also get quantization noise, a rate and learned
        /// steps, once densification is over. In scenes of degree 1 or 2, spherical harmonics are among these
        /// attributes. If off, the encoder searches for the steps of these attributes. Only the `compact` profile
        /// quantizes all of these attributes in the file; the `paper` profile quantizes only the spherical harmonics.
        attributes: bool = false; Flag, "ours, after HAC++";
        /// Weight, in the loss, of a megabyte of those attributes to which `compression.rate.attributes` gives a rate.
        attribute_lambda: f64 = 0.03; WEIGHT, "ours";
        /// The rate is part of the loss once in this many iterations.
        interval: usize = 3; Whole { least: 1, most: 1000 }, "paper";
        /// Share of the planes, and of the Gaussians, on which the rate is estimated. The estimate is unbiased.
        fraction: f64 = 0.125; Number { least: 1e-6, most: 1.0 }, "ours";
        /// From this iteration of the fine stage on, the planes have quantization noise and the rate is part of the
        /// loss. For spherical harmonics, both begin when densification is over.
        from: usize = 1000; ITERATION, "reference: 3, and 2000 for spherical harmonics";
        /// Iteration of the fine stage after which the planes are frozen: they take the values that the file will have,
        /// and only the rest of the scene is still trained. 0 means never.
        planes_until: usize = 27_000;
            ITERATION, "ours";
    }
}

choice! {
    /// The unit of the rate that `compression.rate.lambda` multiplies.
    pub enum RateWeighting: "weighting" {
        /// Megabytes (10^6 bytes) of the file, so that lambda trades bytes for distortion.
        Megabytes = "megabytes",
        /// Bits per plane symbol plus bits per symbol of the spherical harmonics, as in the paper.
        PerSymbol = "per_symbol",
    }
}

keys! {
    /// Parts and sizes of the context model.
    pub struct ContextTraining {
        /// Its parts and sizes.
        #[serde(flatten)]
        model: ContextConfig;
        /// Learning rate of the context model at the first training step.
        learning_rate_init: f64 = 5e-3; RATE, "ours";
        /// Learning rate of the context model at the end of the fine stage.
        learning_rate_final: f64 = 5e-4; RATE, "ours";
        /// If a scene was trained without entropy models, the encoder fits these models to the finished scene, in this
        /// number of training steps.
        fit_iterations: usize = 1500; Whole { least: 1, most: 1_000_000 }, "ours";
    }
}

keys! {
    /// Quantization steps of the planes.
    pub struct PlaneStepsTraining {
        /// The steps at the start.
        #[serde(flatten)]
        initial: AdaptiveQuantizationConfig;
        /// Whether the steps are learned. Learned steps can become coarser than the steps at the start, but never
        /// finer, since finer steps improve only the training frames
        /// ([results](notebook/2026-11-23-hexplane.md#learned-quantization-steps)).
        adaptive: bool = true; Flag, "paper; dropped by the reference";
        /// Iteration of the fine stage from which the steps are learned.
        adaptive_from: usize = 15_000; ITERATION, "paper";
        /// Learning rate of the logarithms of steps, for the steps of planes and of attributes.
        learning_rate: f64 = 2e-3; RATE, "ours";
        /// If a scene was trained without a rate, as imported scenes are, the encoder searches for the coarsest steps
        /// that cost at most this much PSNR, in dB. With 0, the steps are used as they are.
        search_tolerance: f64 = 0.0; DECIBELS, "ours";
    }
}

keys! {
    /// The model of the spherical harmonics beyond degree 0.
    pub struct ShTraining {
        /// The model and its step.
        #[serde(flatten)]
        entropy: ShConfig;
        /// Learning rate of the entropy model of the spherical harmonics, and of the densities of other attributes, at
        /// the first training step.
        learning_rate_init: f64 = 5e-3; RATE, "ours";
        /// Learning rate of the entropy model of the spherical harmonics, and of the densities of other attributes, at the end
        /// of the fine stage.
        learning_rate_final: f64 = 5e-4; RATE, "ours";
        /// The same as `compression.steps.search_tolerance`, but for the step `compression.sh.step`.
        search_tolerance: f64 = 0.0; DECIBELS, "ours";
    }
}

keys! {
    /// Quantization of the attributes other than the spherical harmonics beyond degree 0.
    pub struct AttributesConfig {
        /// Quantization steps by the attributes' names, for the `compact` profile. The step of `means` is a share of
        /// the typical Gaussian's size; other steps are in units of the trained numbers. Further attributes, such as
        /// `stillness` of control nodes or an attribute of a field of your own, can be named as well. If a further
        /// attribute is not named, it has the step that its field gives it. The search of
        /// `compression.attributes.search_tolerance` starts from these steps.
        steps: ByName = built_in(step_of);
            Bounds::ByName(&QUANTIZATION_STEP), "ours";
        /// The encoder searches for the coarsest steps that cost at most this much PSNR on some training views, in dB.
        /// With 0, the steps are used as they are.
        search_tolerance: f64 = 0.05; DECIBELS, "ours";
    }
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

/// A precision in bits, the only form that the configuration has.
fn bits(precision: WeightPrecision) -> u8 {
    match precision {
        WeightPrecision::Bits(bits) => bits,
        // At this precision rounding loses nothing that matters.
        WeightPrecision::Step(_) => MOST_WEIGHT_BITS,
    }
}
