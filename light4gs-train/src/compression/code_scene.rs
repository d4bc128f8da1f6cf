//! From a trained scene to a file: entropy models if there are none yet, training images for the step search, the
//! bytes, and a record of expected and written bits.

use std::time::Instant;

use burn::module::Module;
use burn::tensor::Device;
use light4gs_codec::{Encoded, Kind, PlaneBytes, Profile, SceneData, StreamInfo};
use light4gs_data::{Frame, Scene};
use light4gs_model::attributes::SH_REST;
use light4gs_model::{Backdrop, BuiltInField, DeformationField, DynamicScene, PlaneEntropy, Splatter};
use serde::{Deserialize, Serialize};

use super::{
    AttributeRecord, BitEstimate, BitMap, Compression, CompressionOf, ConfiguredModels, EntropyModels, MissedQuality,
    SearchImages, ShModel, encode, fit, mean_psnr, measured_views, plane_and_sh_step_search, splatter_of,
};
use crate::config::{CompressionConfig, Config, FileProfile};
use crate::dataset::{ImageSource, scene_meta};
use crate::error::TrainError;

/// Training views for the step search.
const SEARCH_VIEWS: usize = 8;

/// PSNR in dB that is assumed for a scene without true images: higher than that of most scenes, so that too much
/// quality is kept rather than too little.
pub const ASSUMED_PSNR: f64 = 40.0;

/// How a file was coded: the bits that the models expected and those that were written; `coding.json` in a run's
/// folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CodingRecord {
    /// Profile of the file.
    pub profile: FileProfile,
    /// Seconds of fitting models to a scene that was trained without them.
    pub fit_seconds: Option<f64>,
    /// Seconds of encoding, checking included.
    pub encode_seconds: f64,
    /// Bits that the models of the training expect.
    pub estimated_bits: BitEstimate,
    /// Bits in the file, without models and tables.
    pub coded_bits: BitEstimate,
    /// Of every attribute of the Gaussians with a trained model.
    #[serde(default)]
    pub attributes: Vec<AttributeRecord>,
    /// Of every plane.
    pub planes: Vec<PlaneRecord>,
    /// The wished quality, if the file does not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missed_quality: Option<MissedQuality>,
}

/// A part of a file with trained models: the expected and the written bits.
#[derive(Clone, Debug, PartialEq)]
pub struct CodedPart {
    /// Its name.
    pub name: String,
    /// Bits that the models of the training expect.
    pub expected: f64,
    /// Bits in the file.
    pub coded: f64,
}

impl CodedPart {
    /// Whether a trained model codes any of it.
    pub fn is_modeled(&self) -> bool {
        self.coded > 0.0 || self.expected.round() > 0.0
    }

    /// The difference as a share of the bits in the file, as text; a word instead of a share if the file has none.
    pub fn difference(&self) -> String {
        match (self.coded > 0.0, self.expected.round() > 0.0) {
            (true, _) => format!("{:+.2} %", (self.expected - self.coded) / self.coded * 100.0),
            (false, true) => "nothing coded".to_owned(),
            (false, false) => "-".to_owned(),
        }
    }
}

impl CodingRecord {
    /// The parts that may have trained models.
    pub fn parts(&self) -> [CodedPart; 3] {
        let (expected, coded) = (self.estimated_bits, self.coded_bits);
        let part = |name: &str, expected, coded| CodedPart { name: name.to_owned(), expected, coded };
        [
            part("feature planes", expected.planes, coded.planes),
            part("spherical harmonics", expected.sh, coded.sh),
            part("other attributes", expected.attributes, coded.attributes),
        ]
    }

    /// Each of the other attributes.
    pub fn attribute_parts(&self) -> impl Iterator<Item = CodedPart> {
        self.attributes.iter().map(|attribute| CodedPart {
            name: attribute.name.clone(),
            expected: attribute.estimated_bits,
            coded: attribute.coded_bits,
        })
    }
}

/// How a plane was coded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaneRecord {
    /// Scale and axes, as in `0.xy`.
    pub name: String,
    /// Quantization step.
    pub step: f32,
    /// Values.
    pub symbols: usize,
    /// Bytes of the latent.
    pub latent_bytes: u64,
    /// Bytes of the values.
    pub value_bytes: u64,
}

/// A trained scene, and its images.
pub struct TrainedScene<'a, F: DeformationField = BuiltInField, E: EntropyModels = ConfiguredModels> {
    /// The model.
    pub scene: &'a DynamicScene<F>,
    /// Its entropy models, if it was trained with them.
    pub compression: Option<&'a CompressionOf<E>>,
    /// Makes the entropy models if it was trained without them.
    pub models: &'a E,
    /// The run's configuration.
    pub config: &'a Config,
    /// The dataset, or cameras around a scene without a dataset.
    pub data: &'a Scene,
    /// Its images, if there are any. Without images the scene is assumed to be [`ASSUMED_PSNR`] from the true ones.
    pub images: Option<&'a dyn ImageSource>,
    /// What is drawn with the scene and is not in its file: the base of a take, for one of its segments.
    pub backdrop: Option<&'a Backdrop>,
    /// With autodiff.
    pub device: &'a Device,
}

/// A file in memory.
#[derive(Clone, Debug)]
pub struct CodedScene {
    /// The file.
    pub bytes: Vec<u8>,
    /// The scene that a decoder gets from it, bit for bit.
    pub decoded: SceneData,
    /// The contents of the file.
    pub info: StreamInfo,
    /// How it was coded, and the bit maps of its planes; `None` in the `float32` profile.
    pub coding: Option<(CodingRecord, Vec<BitMap>)>,
}

impl CodedScene {
    fn new(file: Encoded, coding: Option<(CodingRecord, Vec<BitMap>)>) -> Self {
        let Encoded { bytes, decoded, info, .. } = file;
        Self { bytes, decoded, info, coding }
    }
}

/// Encodes a trained scene in the profile of its configuration. If the scene was trained without entropy models, they
/// are fitted first; `progress` is called with the number of iterations done and their total.
///
/// # Errors
/// - [`TrainError::Codec`] if the codec refuses the scene, for example for values that are not finite
/// - [`TrainError::Model`] if the field cannot be written to a file, or read from one
/// - [`TrainError::Data`] for an image that cannot be read
/// - [`TrainError::Input`] for a `compression.target_bytes` that is too small, or a `compression.target_db` without images
/// - [`TrainError::Diverged`] if the entropy models cannot be fitted
/// - the error of `progress`
pub fn code_scene<F: DeformationField, E: EntropyModels>(
    trained: &TrainedScene<F, E>,
    progress: &mut dyn FnMut(usize, usize) -> Result<(), TrainError>,
) -> Result<CodedScene, TrainError> {
    let TrainedScene { scene, config, data: dataset, .. } = trained;
    let data = scene.to_arrays(scene_meta(config, dataset))?;
    let Some(profile) = config.compression.profile.coded() else {
        return Ok(CodedScene::new(light4gs_codec::encode_exactly(&data)?, None));
    };
    let (views, device) = (search_views(dataset), trained.device.clone().inner());
    let render = |data: &SceneData| {
        let scene = DynamicScene::<F>::from_arrays(data, &device).expect("arrays that came from a model make one");
        render_views(&scene, &trained.splatter(data), &views)
    };
    let psnr = |data: &SceneData| trained.measured_psnr(data, &device);
    let mut images = None;
    if profile == Profile::Compact && searches(&config.compression, trained.compression) {
        let exact = render_views(&decodable::<F>(&data, &device)?, &trained.splatter(&data), &views);
        let error = trained.squared_error(&exact, &views)?;
        let blank = is_blank(&exact, data.meta.background);
        images = Some(SearchImages { render: &render, exact, blank, error, psnr: &psnr });
    }
    let Models { compression, settings, fit_seconds } = match trained.compression {
        Some(compression) => Models::of_training(compression, config),
        None => trained.fit_models(&data, images.as_ref(), progress)?,
    };
    let begin = Instant::now();
    let encoded = encode(scene, &data, &compression, &settings, profile, images, trained.device)?;
    let encode_seconds = begin.elapsed().as_secs_f64();
    let record = CodingRecord {
        profile: settings.profile,
        fit_seconds,
        encode_seconds,
        estimated_bits: encoded.estimate,
        coded_bits: coded_bits(&encoded.file, &compression, profile),
        attributes: encoded.attributes,
        planes: plane_records(&encoded.file, &compression),
        missed_quality: encoded.missed,
    };
    Ok(CodedScene::new(encoded.file, Some((record, encoded.bit_maps))))
}

/// Entropy models of a scene, and the settings with which they code it.
struct Models<E: EntropyModels> {
    compression: CompressionOf<E>,
    settings: CompressionConfig,
    /// Seconds of fitting, if they were not trained with the scene.
    fit_seconds: Option<f64>,
}

impl<E: EntropyModels> Models<E> {
    fn of_training(compression: &CompressionOf<E>, config: &Config) -> Self {
        Self { compression: compression.clone(), settings: config.compression.clone(), fit_seconds: None }
    }
}

impl<F: DeformationField, E: EntropyModels> TrainedScene<'_, F, E> {
    /// Whether the views by which steps are searched show anything but the background.
    ///
    /// # Errors
    /// [`TrainError::Model`] if the field cannot be written to a file.
    pub fn is_seen(&self) -> Result<bool, TrainError> {
        let scene = self.scene.clone().valid();
        let data = scene.to_arrays(scene_meta(self.config, self.data))?;
        Ok(!is_blank(&render_views(&scene, &self.splatter(&data), &search_views(self.data)), data.meta.background))
    }

    /// Draws the scene whose arrays are `data`, with what is behind it.
    fn splatter(&self, data: &SceneData) -> Splatter {
        splatter_of(data).with_backdrop(self.backdrop.cloned())
    }

    /// Fits models to the scene, whose arrays are `data`; with images, it searches the steps of planes and harmonics first.
    fn fit_models(
        &self,
        data: &SceneData,
        images: Option<&SearchImages>,
        progress: &mut dyn FnMut(usize, usize) -> Result<(), TrainError>,
    ) -> Result<Models<E>, TrainError> {
        let mut config = self.config.clone();
        match images {
            Some(images) if images.blank => {}
            Some(images) => plane_and_sh_step_search::search(data, &mut config.compression, images),
            // Where there are images, this was checked before.
            None => drop(decodable::<F>(data, &self.device.clone().inner())?),
        }
        let begin = Instant::now();
        let compression = fit(self.models, self.scene, &config, self.device, progress)?;
        let fit_seconds = Some(begin.elapsed().as_secs_f64());
        Ok(Models { compression, settings: config.compression, fit_seconds })
    }

    /// Mean squared error of rendered views; without true images, that of [`ASSUMED_PSNR`].
    fn squared_error(&self, rendered: &[f32], views: &[&Frame]) -> Result<f64, TrainError> {
        match self.images {
            Some(images) => mean_squared_error(rendered, views, images),
            None => Ok(10f64.powf(-ASSUMED_PSNR / 10.0)),
        }
    }

    /// The PSNR of a decoded scene by which `compression.target_db` is reached, dB.
    fn measured_psnr(&self, decoded: &SceneData, device: &Device) -> Result<f64, TrainError> {
        let Some(images) = self.images else {
            return Err(TrainError::Input(
                "compression.target_db needs the images of a dataset, and this scene has none; name one (`import --scene \
                 DIR`), or bound the bytes with compression.target_bytes"
                    .into(),
            ));
        };
        mean_psnr::<F>(decoded, &self.splatter(decoded), measured_views(self.data), images, device)
    }
}

/// The scene that a decoder makes of arrays. A field that cannot be decoded is refused here, before anything is fitted.
fn decodable<F: DeformationField>(data: &SceneData, device: &Device) -> Result<DynamicScene<F>, TrainError> {
    Ok(DynamicScene::from_arrays(data, device)?)
}

/// Whether the search for steps needs renderings. Steps of planes and harmonics can change only before models are
/// fitted; those of other attributes unless they were learned, or for a wished quality.
fn searches<C: PlaneEntropy, S: ShModel>(settings: &CompressionConfig, trained: Option<&Compression<C, S>>) -> bool {
    let fitted = settings.steps.search_tolerance > 0.0 || settings.sh.search_tolerance > 0.0;
    let learned = trained.is_some_and(|models| models.learned_attributes().is_some());
    let wished = settings.target_db > 0.0;
    wished || (settings.attributes.search_tolerance > 0.0 && !learned) || (trained.is_none() && fitted)
}

/// The bits in a file, without models and tables. Attributes count where they have a trained model.
fn coded_bits<C: PlaneEntropy, S: ShModel>(
    file: &Encoded,
    compression: &Compression<C, S>,
    profile: Profile,
) -> BitEstimate {
    let planes: u64 = file.info.plane_bytes.iter().map(PlaneBytes::total).sum();
    let gaussians = file.info.sections.iter().filter(|section| section.kind == Kind::GaussiansExplicit);
    let gaussians: u64 = gaussians.map(|section| section.bytes).sum();
    let harmonics = file.attribute_bytes(&SH_REST.name);
    // Spherical harmonics that are coded as an attribute count as one. If training had a model for them, they are left out:
    // that model says nothing about this coding.
    let (sh, with_sh) = match (file.sh_is_an_attribute(), compression.sh.is_some()) {
        (true, true) => (0, 0),
        (true, false) => (0, harmonics),
        (false, _) => (harmonics, 0),
    };
    // Only this profile quantizes attributes.
    let models_attributes = profile == Profile::Compact && compression.learned_attributes().is_some();
    let attributes = if models_attributes { gaussians + with_sh } else { 0 };
    let bits = |bytes: u64| 8.0 * bytes as f64;
    BitEstimate { planes: bits(planes), sh: bits(sh), attributes: bits(attributes) }
}

fn plane_records<C: Module, S: Module>(file: &Encoded, compression: &Compression<C, S>) -> Vec<PlaneRecord> {
    let Some(models) = &compression.planes else { return Vec::new() };
    let steps = models.quantization.steps_without_gradient().values();
    let record = |bytes: &PlaneBytes| {
        let plane = &file.decoded.feature_planes.planes[bytes.plane];
        PlaneRecord {
            name: plane.shape().name(),
            step: steps[bytes.plane],
            symbols: plane.values.len(),
            latent_bytes: bytes.latent,
            value_bytes: bytes.anchors + bytes.others,
        }
    };
    file.info.plane_bytes.iter().map(record).collect()
}

fn search_views(data: &Scene) -> Vec<&Frame> {
    let stride = data.train.len().div_ceil(SEARCH_VIEWS).max(1);
    data.train.iter().step_by(stride).collect()
}

/// Pixel values of all views of a scene, clamped to [0, 1].
fn render_views<F: DeformationField>(scene: &DynamicScene<F>, splatter: &Splatter, views: &[&Frame]) -> Vec<f32> {
    let image = |frame: &&Frame| {
        let image = splatter.render(scene.at(frame.time), &frame.camera, None).image;
        image.clamp(0.0, 1.0).into_data().iter::<f32>().collect::<Vec<_>>()
    };
    views.iter().flat_map(image).collect()
}

/// Whether pixels show a background alone.
fn is_blank(pixels: &[f32], background: [f32; 3]) -> bool {
    pixels.chunks_exact(3).all(|pixel| pixel == background.map(|value| value.clamp(0.0, 1.0)))
}

fn mean_squared_error(pixels: &[f32], views: &[&Frame], images: &dyn ImageSource) -> Result<f64, TrainError> {
    let mut sum = 0.0;
    let mut rest = pixels;
    for frame in views {
        let truth = images.image(frame)?;
        let (own, others) = rest.split_at(truth.pixels.len());
        let errors = own.iter().zip(&truth.pixels).map(|(value, byte)| f64::from(*value) - f64::from(*byte) / 255.0);
        sum += errors.map(|error| error.powi(2)).sum::<f64>();
        rest = others;
    }
    Ok(sum / pixels.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::CodedPart;

    #[test]
    fn a_share_of_nothing_is_no_share() {
        let difference = |expected, coded| CodedPart { name: "planes".into(), expected, coded }.difference();
        assert_eq!(difference(101.0, 100.0), "+1.00 %");
        assert_eq!(difference(108_299.0, 0.0), "nothing coded");
        assert_eq!(difference(0.0, 0.0), "-");
    }
}
