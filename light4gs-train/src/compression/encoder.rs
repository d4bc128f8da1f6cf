//! From a scene and its entropy models to the bytes of a file (paper III-E, docs/design.md).

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::network_weights::WeightPrecision;
use light4gs_codec::{
    CodecError, CompressionInput, Compressor, Encoded, GaussianArrays, GaussianLayers, Limits, PlaneCoding, Profile,
    SceneData, SceneMeta, ShCoding, WeightPrecisions, checks, sh_rest_coefficients,
};
use light4gs_model::attributes::SH_REST;
use light4gs_model::{DeformationField, DynamicScene, FeaturePlanes, Latent, PlaneEntropy, counted_sh_coding};
use serde::{Deserialize, Serialize};

use super::rate::{known, plane_tensors};
use super::step_factor::{ScaledFile, encode_to_quality, encode_to_size};
use super::{AttributeRecord, Compression, MissedQuality, ShModel, attribute_step_search};
use crate::config::CompressionConfig;
use crate::error::TrainError;

/// A file in memory, and the bits that the entropy models expected.
#[derive(Clone, Debug)]
pub struct EncodedScene {
    /// The file, the scene that a decoder gets from it, and the bytes of each part. It has been verified.
    pub file: Encoded,
    /// The bits that the models of the training expect for the decoded scene.
    pub estimate: BitEstimate,
    /// Expected and written bits of each attribute with a learned step, if the profile quantizes attributes.
    pub attributes: Vec<AttributeRecord>,
    /// The expected bits of every place of every plane.
    pub bit_maps: Vec<BitMap>,
    /// The wished quality, if the file does not have it.
    pub missed: Option<MissedQuality>,
}

/// Bits at each place of a plane, all channels together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BitMap {
    /// Scale and axes, as in `0.xy`.
    pub name: String,
    /// Size along the first axis.
    pub width: u32,
    /// Size along the second axis.
    pub height: u32,
    /// `[height, width]` row-major.
    pub bits: Vec<f32>,
}

impl BitMap {
    /// Why a map from a file cannot be drawn: it must have as many numbers as places, and none below 0.
    pub fn problem(&self) -> Option<String> {
        let Self { name, width, height, bits } = self;
        let places = u64::from(*width) * u64::from(*height);
        if bits.is_empty() || bits.len() as u64 != places {
            return Some(format!("the map of plane `{name}` is {width}×{height}, but has {} numbers", bits.len()));
        }
        let bad = bits.iter().find(|bits| !(bits.is_finite() && **bits >= 0.0))?;
        Some(format!("the map of plane `{name}` has the number {bad}, expected bits"))
    }
}

/// Bits that the training's models expect for a decoded scene, without model weights and tables.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BitEstimate {
    /// Of the feature planes' values and latents.
    pub planes: f64,
    /// Of the spherical harmonics beyond degree 0, if they have a model of their own.
    pub sh: f64,
    /// Of the other attributes of the Gaussians, if they have a model.
    #[serde(default)]
    pub attributes: f64,
}

/// Images for the search of steps.
pub struct SearchImages<'a> {
    /// Renders some training views of a scene, as pixel values.
    pub render: &'a dyn Fn(&SceneData) -> Vec<f32>,
    /// These pixel values for the unquantized scene.
    pub exact: Vec<f32>,
    /// Whether they show the background alone: then they say nothing about steps, and those of the configuration are taken.
    pub blank: bool,
    /// Mean squared error of [`SearchImages::exact`].
    pub error: f64,
    /// The PSNR by which `compression.target_db` is reached, dB.
    pub psnr: &'a dyn Fn(&SceneData) -> Result<f64, TrainError>,
}

/// Encodes a scene in a profile; `data` is the scene as plain arrays. Before this returns, everything that was coded is
/// decoded again and compared.
///
/// # Errors
/// - [`TrainError::Codec`] if the codec refuses the scene
/// - [`TrainError::Input`] if no file is as small as `compression.target_bytes`
/// - [`TrainError::Data`] for an image that cannot be read
pub fn encode<F: DeformationField, C: PlaneEntropy, S: ShModel>(
    scene: &DynamicScene<F>,
    data: &SceneData,
    compression: &Compression<C, S>,
    config: &CompressionConfig,
    profile: Profile,
    images: Option<SearchImages>,
    device: &Device,
) -> Result<EncodedScene, TrainError> {
    let (scene, device) = (&scene.valid(), &device.clone().inner());
    let compression = &mut compression.valid();
    let mut input = compression_input(compression, scene, data, config, profile)?;
    if let (Some(images), Profile::Compact, None) = (&images, profile, compression.learned_attributes())
        && config.attributes.search_tolerance > 0.0
        && !images.blank
    {
        let tolerance = config.attributes.search_tolerance;
        // The search tries much finer steps than the given ones. Values that are too large for these, as in a training
        // that has diverged, may still fit the given steps.
        let found = attribute_step_search::search(data, &input.attributes, tolerance, images.error, images.render);
        input.attributes = found.unwrap_or(input.attributes);
    }
    let (file, missed) = wished_file(data, &input, config, images)?;
    file.encoded.verify(&Limits::large())?;
    if let Some(models) = &mut compression.attributes {
        models.scale_steps(file.factor);
    }
    let ScaledFile { encoded: file, sh, .. } = file;
    let decoded = DynamicScene::<F>::from_arrays(&file.decoded, device)?;
    let attributes = match profile {
        Profile::Compact => compression.attribute_records(&file, &decoded.gaussians),
        Profile::Paper => Vec::new(),
    };
    let estimate = BitEstimate {
        planes: compression.plane_bits(&decoded),
        sh: compression.sh_bits(&decoded, &file.decoded.gaussians, &sh),
        attributes: attributes.iter().map(|attribute| attribute.estimated_bits).sum(),
    };
    let bit_maps = compression.bit_maps(&decoded);
    Ok(EncodedScene { file, estimate, attributes, bit_maps, missed })
}

/// The file of the size or the quality that the configuration wishes; without a wish, that of the given steps.
fn wished_file(
    data: &SceneData,
    input: &CompressionInput,
    config: &CompressionConfig,
    images: Option<SearchImages>,
) -> Result<(ScaledFile, Option<MissedQuality>), TrainError> {
    let compressor = Compressor::new(data, input)?;
    match (config.target_bytes, config.target_db, images) {
        (target @ 1.., ..) => Ok((encode_to_size(&compressor, input, target)?, None)),
        (0, target, Some(images)) if target > 0.0 => encode_to_quality(&compressor, input, target, images.psnr),
        _ => Ok((ScaledFile::unscaled(&compressor, input)?, None)),
    }
}

/// A scene's file as it stands, with the steps that training has learned so far. No step is searched for, and the file is
/// not verified, since it is measured and not kept.
///
/// # Errors
/// [`TrainError::Codec`] if the codec refuses the scene; [`TrainError::Model`] if the field cannot be written to a file.
pub fn encoded_so_far<F: DeformationField, C: PlaneEntropy, S: ShModel>(
    scene: &DynamicScene<F>,
    compression: &Compression<C, S>,
    meta: SceneMeta,
    config: &CompressionConfig,
) -> Result<Encoded, TrainError> {
    let (scene, compression) = (&scene.valid(), &mut compression.valid());
    let data = scene.to_arrays(meta)?;
    let input = compression_input(compression, scene, &data, config, Profile::Compact)?;
    Ok(unverified(&data, &input)?)
}

/// The file of an input, which is not decoded again.
fn unverified(data: &SceneData, input: &CompressionInput) -> Result<Encoded, CodecError> {
    Compressor::new(data, input)?.encode(&input.attributes, &input.sh)
}

/// Rounds in which [`freeze_planes`] looks for planes that no longer change.
const FREEZING_ROUNDS: usize = 8;

/// A scene's planes as a decoder of the `compact` profile gets them, such that encoding them again changes nothing. The
/// latent is computed from the planes, so decoded planes may have another latent, and then decode to other values.
/// Therefore they are encoded and decoded until they no longer change. With some hyperpriors that never happens, and
/// each round would move the planes further from the trained ones. Then the result is the planes of the first round;
/// encoding them again rounds them once more.
///
/// `None` if there are no planes or no models for them. `device`, with autodiff, is the device of the result.
///
/// Planes depend neither on Gaussians nor on their motion, so the scene that is encoded here has neither.
///
/// # Errors
/// [`TrainError::Codec`] if the codec refuses the planes: values that are not finite, or beyond its range of symbols.
pub fn freeze_planes<F: DeformationField, C: PlaneEntropy, S: ShModel>(
    scene: &DynamicScene<F>,
    compression: &Compression<C, S>,
    config: &CompressionConfig,
    device: &Device,
) -> Result<Option<FeaturePlanes>, TrainError> {
    let mut scene = scene.valid();
    let compression = &mut compression.valid();
    if scene.planes().is_none() || compression.planes.is_none() {
        return Ok(None);
    }
    let mut data = scene.to_arrays_at_rest(SceneMeta::default());
    data.gaussians = GaussianArrays { sh_degree: data.gaussians.sh_degree, ..GaussianArrays::default() };
    let mut first = None;
    for _ in 0..FREEZING_ROUNDS {
        let input = compression_input(compression, &scene, &data, config, Profile::Compact)?;
        let decoded = unverified(&data, &input)?.decoded.feature_planes;
        if decoded == data.feature_planes {
            first = None;
            break;
        }
        if let Some(planes) = scene.planes_mut() {
            *planes = FeaturePlanes::from_arrays(&decoded, &device.clone().inner())?;
        }
        first.get_or_insert_with(|| decoded.clone());
        data.feature_planes = decoded;
    }
    Ok(Some(FeaturePlanes::from_arrays(&first.unwrap_or(data.feature_planes), device)?))
}

/// The input for the codec to compress a scene, with the attribute steps of the configuration. `data` is the scene as
/// plain arrays.
///
/// # Errors
/// [`TrainError::Config`] if the configuration has a step for an attribute that the Gaussians do not have;
/// [`TrainError::Codec`] if the codec refuses a model of the planes or of the spherical harmonics.
pub fn compression_input<F: DeformationField, C: PlaneEntropy, S: ShModel>(
    compression: &mut Compression<C, S>,
    scene: &DynamicScene<F>,
    data: &SceneData,
    config: &CompressionConfig,
    profile: Profile,
) -> Result<CompressionInput, TrainError> {
    if let Some(models) = &mut compression.planes {
        models.context.base_mut().update_quantiles();
    }
    let mut attributes = config.attributes.steps_of(scene.gaussians.attributes())?;
    if let Some(models) = compression.learned_attributes() {
        attributes = models.steps(attributes, &data.gaussians.log_scales);
    }
    Ok(CompressionInput {
        profile,
        planes: compression.plane_coding(scene)?,
        sh: compression.sh_coding(&data.gaussians, config.sh.entropy.step as f32, profile)?,
        attributes,
        weights: WeightPrecisions {
            motion: WeightPrecision::Bits(config.weights.deformation_bits),
            context_model: WeightPrecision::Bits(config.weights.context_bits),
            sh: WeightPrecision::Bits(config.weights.context_bits),
        },
        layers: GaussianLayers::new(config.layers as u32),
    })
}

impl<C: PlaneEntropy, S: ShModel> Compression<C, S> {
    /// The input for the codec to code the planes.
    fn plane_coding<F: DeformationField>(&self, scene: &DynamicScene<F>) -> Result<Option<PlaneCoding>, TrainError> {
        let (Some(models), Some(planes)) = (&self.planes, scene.planes()) else { return Ok(None) };
        let steps = models.quantization.steps_without_gradient();
        let symbols = models.context.latent_symbols(&planes.tensors(), &steps);
        let integers = |symbols: Tensor<3>| symbols.into_data().iter::<f32>().map(|v| v as i32).collect();
        Ok(Some(PlaneCoding {
            model: models.context.to_arrays(planes.layout())?,
            steps: steps.to_groups(planes.layout()).into_iter().map(checks::nearest_plane_steps).collect(),
            latent_symbols: symbols.into_iter().map(|plane| plane.map_or_else(Vec::new, integers)).collect(),
        }))
    }

    /// How the spherical harmonics are coded.
    fn sh_coding(&self, gaussians: &GaussianArrays, step: f32, profile: Profile) -> Result<ShCoding, CodecError> {
        match (&self.sh, profile) {
            (Some(sh), Profile::Compact) if is_superseded(sh) => Ok(ShCoding::Channels { step: sh.step() }),
            (Some(sh), _) => sh.to_coding(&gaussians.sh_rest),
            (None, _) => {
                let learned = self.learned_attributes().and_then(|models| models.step(&SH_REST.name));
                let step = learned.map_or(step, checks::nearest_sh_step);
                match profile {
                    Profile::Compact => Ok(ShCoding::Channels { step }),
                    Profile::Paper => {
                        let channels = 3 * sh_rest_coefficients(gaussians.sh_degree);
                        counted_sh_coding(&gaussians.sh_rest, channels, step)
                    }
                }
            }
        }
    }

    /// Bits that the model expects for the planes of a decoded scene; 0 without a model.
    fn plane_bits<F: DeformationField>(&self, decoded: &DynamicScene<F>) -> f64 {
        let Some(models) = &self.planes else { return 0.0 };
        let planes = plane_tensors(decoded);
        let all: Vec<usize> = (0..planes.len()).collect();
        let steps = models.quantization.steps_without_gradient();
        let rates = models.context.rate(&planes, &steps, &all, Latent::Rounded);
        rates.into_iter().map(|rate| rate.total().into_scalar::<f64>()).sum()
    }

    /// The same for its spherical harmonics; `gaussians` are those of the scene as plain arrays.
    fn sh_bits<F: DeformationField>(
        &self,
        decoded: &DynamicScene<F>,
        gaussians: &GaussianArrays,
        coding: &ShCoding,
    ) -> f64 {
        match &self.sh {
            Some(sh) if !gaussians.is_empty() && !matches!(coding, ShCoding::Channels { .. }) => {
                let known = known(decoded, &plane_tensors(decoded), None);
                sh.bits(decoded.gaussians.sh_rest.val(), &known).sum().into_scalar()
            }
            _ => counted_bits(gaussians, coding),
        }
    }

    /// The bit maps of a decoded scene's planes.
    fn bit_maps<F: DeformationField>(&self, decoded: &DynamicScene<F>) -> Vec<BitMap> {
        let Some(models) = &self.planes else { return Vec::new() };
        let planes = plane_tensors(decoded);
        let all: Vec<usize> = (0..planes.len()).collect();
        let steps = models.quantization.steps_without_gradient();
        let maps = models.context.bit_map(&planes, &steps, &all, Latent::Rounded);
        let map = |(plane, map): (usize, Tensor<2>)| {
            let [height, width] = map.dims().map(|length| length as u32);
            BitMap {
                name: planes.layout().planes()[plane].name(),
                width,
                height,
                bits: map.into_data().iter().collect(),
            }
        };
        maps.into_iter().enumerate().map(map).collect()
    }
}

/// Whether the `compact` profile codes spherical harmonics without this model: prediction from neighbors saves more than a
/// density that is the same for all Gaussians.
pub(super) fn is_superseded(sh: &impl ShModel) -> bool {
    sh.tables().is_some()
}

/// Bits according to the frequency tables themselves, where no model was trained.
fn counted_bits(gaussians: &GaussianArrays, coding: &ShCoding) -> f64 {
    let ShCoding::Tables { step, tables } = coding else { return 0.0 };
    let channels = tables.len().max(1);
    let symbols = gaussians.sh_rest.iter().enumerate();
    symbols.map(|(i, value)| tables[i % channels].bits((value / step).round() as i32)).sum()
}
