//! What `train` and `encode` share: models if there are none yet, training pictures for the step search, the file, and
//! the record of what was expected and what came out.

use std::path::Path;
use std::time::Instant;

use burn::tensor::Device;
use indicatif::{ProgressBar, ProgressStyle};
use light4gs_codec::{SceneData, write_atomically};
use light4gs_data::{DataError, Frame, ImageStore, Scene};
use light4gs_model::{DynamicScene, Splatter};
use serde::{Deserialize, Serialize};

use super::{BitEstimate, CodedSizes, Compression, EncodedScene, Pictures, encode, fit, plane_name};
use crate::config::Config;
use crate::error::TrainError;
use crate::trainer::{image_tensor, scene_meta};

/// Training views that the step search looks at.
const SEARCH_VIEWS: usize = 8;

/// How a file was coded: what the models expected of it and what it took, `coding.json` in a run's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CodingRecord {
    /// Profile of the file.
    pub profile: String,
    /// Seconds of fitting models to a scene that was trained without them.
    pub fit_seconds: Option<f64>,
    /// Seconds of encoding, checking included.
    pub encode_seconds: f64,
    /// Bits that the models of the training give.
    pub estimated_bits: BitEstimate,
    /// Bits in the file, models and tables aside.
    pub coded_bits: BitEstimate,
    /// Of every plane.
    pub planes: Vec<PlaneRecord>,
}

/// How a plane was coded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaneRecord {
    /// Scale and axes, as in `0.xy`.
    pub name: String,
    /// Quantisation step.
    pub step: f32,
    /// Values.
    pub symbols: usize,
    /// Bytes of the hyperprior.
    pub hyperprior_bytes: u64,
    /// Bytes of the values.
    pub value_bytes: u64,
}

impl CodingRecord {
    /// Largest relative difference between expected and coded bits, of the coded ones.
    pub fn largest_error(&self) -> f64 {
        let (e, c) = (self.estimated_bits, self.coded_bits);
        let error = |estimated: f64, coded: f64| if coded > 0.0 { (estimated - coded).abs() / coded } else { 0.0 };
        error(e.hexplanes, c.hexplanes).max(error(e.sh, c.sh))
    }
}

/// A scene as trained, and where its pictures are.
pub struct TrainedScene<'a> {
    /// The model.
    pub scene: &'a DynamicScene,
    /// Its entropy models, if it was trained with them.
    pub compression: Option<&'a Compression>,
    /// The run's.
    pub config: &'a Config,
    /// The dataset.
    pub data: &'a Scene,
    /// Its pictures.
    pub images: &'a ImageStore,
    /// With autodiff.
    pub device: &'a Device,
}

/// Encodes a trained scene and writes the file, whole or not at all. Returns what was written, and how it was coded
/// unless the profile is `float32`.
pub fn write_scene(
    trained: &TrainedScene,
    path: &Path,
    quiet: bool,
) -> Result<(EncodedScene, Option<CodingRecord>), TrainError> {
    let TrainedScene { scene, config, data, device, .. } = trained;
    let meta = scene_meta(config, data);
    let settings = &config.compression;
    let mut fit_seconds = None;
    let mut compression = match trained.compression {
        Some(compression) => compression.clone(),
        None if settings.profile == "float32" => Compression::new(config, device),
        None => {
            let begin = Instant::now();
            let iterations = settings.context.fit_iterations;
            let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(iterations as u64) };
            let style = "   fit {wide_bar:.cyan/blue} {pos}/{len}  {per_sec}  ETA {eta}";
            bar.set_style(ProgressStyle::with_template(style).expect("a valid template"));
            let compression = fit(scene, config, device, |iteration| bar.set_position(iteration as u64));
            bar.finish();
            fit_seconds = Some(begin.elapsed().as_secs_f64());
            compression
        }
    };
    let begin = Instant::now();
    let views = search_views(data);
    let inner = (*device).clone().inner();
    let render = |data: &SceneData| render_views(data, &views, &inner);
    let pictures = match settings.attributes.search_tolerance > 0.0 && settings.profile == "compact" {
        true => {
            let error = mean_squared_error(&render(&scene.to_arrays(meta.clone())), &views, trained.images, &inner)?;
            Some(Pictures { render: &render, error })
        }
        false => None,
    };
    let encoded = encode(scene, &mut compression, meta, settings, pictures, device)?;
    write_atomically(path, &encoded.bytes).map_err(|source| DataError::Io {
        action: "write",
        path: path.to_owned(),
        source,
    })?;
    let record = encoded.coded.as_ref().map(|coded| CodingRecord {
        profile: settings.profile.clone(),
        fit_seconds,
        encode_seconds: begin.elapsed().as_secs_f64(),
        ..record(coded, &encoded.decoded, &compression)
    });
    Ok((encoded, record))
}

fn record(coded: &CodedSizes, decoded: &SceneData, compression: &Compression) -> CodingRecord {
    let steps = compression.quantization.steps().values();
    let planes: Vec<PlaneRecord> = coded
        .report
        .planes
        .iter()
        .map(|bytes| PlaneRecord {
            name: plane_name(bytes.plane),
            step: steps[bytes.plane],
            symbols: decoded.hexplane.planes[bytes.plane].values.len(),
            hyperprior_bytes: bytes.hyperprior,
            value_bytes: bytes.anchors + bytes.others,
        })
        .collect();
    let hexplane_bytes: u64 = coded.report.planes.iter().map(|plane| plane.total()).sum();
    let sh_bytes: u64 = coded.report.sh.degrees.iter().sum();
    CodingRecord {
        profile: String::new(),
        fit_seconds: None,
        encode_seconds: 0.0,
        estimated_bits: coded.estimate,
        coded_bits: BitEstimate { hexplanes: 8.0 * hexplane_bytes as f64, sh: 8.0 * sh_bytes as f64 },
        planes,
    }
}

fn search_views(data: &Scene) -> Vec<&Frame> {
    let stride = data.train.len().div_ceil(SEARCH_VIEWS).max(1);
    data.train.iter().step_by(stride).collect()
}

/// Pixel values of all views, clamped to [0, 1].
fn render_views(data: &SceneData, views: &[&Frame], device: &Device) -> Vec<f32> {
    let scene = DynamicScene::from_arrays(data, device).expect("arrays that came from a model make one");
    let splatter = Splatter::new(data.meta.background, usize::from(data.gaussians.sh_degree));
    let picture = |frame: &&Frame| {
        let image = splatter.render(scene.at(frame.time), &frame.camera, None).image;
        image.clamp(0.0, 1.0).into_data().iter::<f32>().collect::<Vec<_>>()
    };
    views.iter().flat_map(picture).collect()
}

fn mean_squared_error(
    pixels: &[f32],
    views: &[&Frame],
    images: &ImageStore,
    device: &Device,
) -> Result<f64, TrainError> {
    let mut sum = 0.0;
    let mut rest = pixels;
    for frame in views {
        let truth: Vec<f32> = image_tensor(&*images.get(frame)?, device).into_data().iter().collect();
        let (own, others) = rest.split_at(truth.len());
        sum += own.iter().zip(&truth).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        rest = others;
    }
    Ok(sum / pixels.len().max(1) as f64)
}
