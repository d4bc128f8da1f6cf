//! Measuring a decoded file: quality on held-out views, speed, size.

mod advice;
mod run;

use std::path::Path;
use std::time::Instant;

use burn::tensor::{Device, Tensor};
use light4gs_codec::{Decoded, Limits, OpenStream, SceneData, SectionInfo, StreamInfo, read_file_and};
use light4gs_data::{Camera, Frame, RgbImage8, RgbImage32, Scene, Split};
use light4gs_model::{Backdrop, BuiltInField, DeformationField, DynamicScene, Splatter};
use serde::Serialize;

use crate::compression::{CodingRecord, splatter_of};
use crate::config::EvalConfig;
use crate::corrections::{Fitted, ViewFit};
use crate::dataset::ImageSource;
use crate::error::TrainError;
use crate::metrics::image_tensor;
use crate::metrics::lpips::Lpips;
use crate::metrics::scores::Scores;
pub use run::measure_run;

/// Quality of one view.
#[derive(Clone, Debug, Serialize)]
pub struct ViewScore {
    /// Name of the frame.
    pub name: String,
    /// The frame's time, in [0, 1].
    pub time: f32,
    /// Its scores.
    #[serde(flatten)]
    pub scores: Scores,
    /// The same after a fit of what the run corrects in its training views: only where it corrects anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitted: Option<FittedScore>,
}

/// Quality of one view after a fit of its exposure, pose or time, with the scene as it is.
#[derive(Clone, Debug, Serialize)]
pub struct FittedScore {
    /// The scores.
    #[serde(flatten)]
    pub scores: Scores,
    /// The numbers that were fitted.
    pub correction: Fitted,
}

/// Quality of a split.
#[derive(Clone, Debug, Serialize)]
pub struct SplitScore {
    /// `test`, `val`...
    pub split: String,
    /// The scores over the views.
    #[serde(flatten)]
    pub scores: Scores,
    /// The same after a fit of each view: see [`ViewScore::fitted`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitted: Option<Scores>,
    /// Every view.
    pub views: Vec<ViewScore>,
}

/// Bytes of one part of the file.
#[derive(Clone, Debug, Serialize)]
pub struct SectionSize {
    /// Name of the section.
    pub name: String,
    /// Its size on disk.
    pub bytes: u64,
}

/// All results, as in `eval.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Back end, and the adapter if it has one.
    pub device: String,
    /// Size of the file on disk.
    pub bytes: u64,
    /// By section, header included.
    pub sections: Vec<SectionSize>,
    /// Gaussians in the file.
    pub gaussians: usize,
    /// Width and height of the measured images.
    pub resolution: [u32; 2],
    /// Frames per second, deformation included, decoding excluded, after warm-up.
    pub fps: f64,
    /// Seconds to read, check and decode the file.
    pub decode_seconds: f64,
    /// Seconds of training, where known.
    pub training_seconds: Option<f64>,
    /// One entry for each measured split.
    pub splits: Vec<SplitScore>,
    /// Expected and coded bits, where the run has a record of its coding.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coding: Option<CodingRecord>,
    /// If the run came out badly: what its figures say about capture and schedule, and what to do.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub advice: Vec<String>,
}

/// A render next to its ground truth.
#[derive(Clone, Debug)]
pub struct RenderedView {
    /// Split and frame.
    pub split: Split,
    /// Name of the frame.
    pub name: String,
    /// Its time, in [0, 1].
    pub time: f32,
    /// PSNR in dB.
    pub psnr: f64,
    /// The frame of the dataset.
    pub truth: RgbImage8,
    /// The rendering of the decoded file.
    pub render: RgbImage8,
}

/// A decoded file, ready to render.
pub struct DecodedScene<F: DeformationField = BuiltInField> {
    /// The model on the device.
    pub model: DynamicScene<F>,
    /// The description of the scene in the file.
    pub data: SceneData,
    /// Sections and sizes.
    pub info: StreamInfo,
    /// Seconds taken by decoding.
    pub decode_seconds: f64,
    /// What is drawn behind it and is not in the file: the base of a take, for one of its segments.
    pub backdrop: Option<Backdrop>,
    device: Device,
}

impl<F: DeformationField> DecodedScene<F> {
    /// Reads a file onto a device, within the default [`Limits`].
    ///
    /// # Errors
    /// [`TrainError::Codec`] for a file that cannot be read, or that the codec refuses; [`TrainError::Model`] if `F` cannot
    /// be made from its parts.
    pub fn open(path: &Path, device: &Device) -> Result<Self, TrainError> {
        Self::open_with_limits(path, &Limits::default(), device)
    }

    /// As [`DecodedScene::open`], within the given limits; for a file that you made yourself they may be
    /// [`Limits::large`].
    ///
    /// # Errors
    /// As [`DecodedScene::open`].
    pub fn open_with_limits(path: &Path, limits: &Limits, device: &Device) -> Result<Self, TrainError> {
        let begin = Instant::now();
        let decode = |bytes: &[u8]| OpenStream::with_limits(bytes, limits)?.decode();
        let Decoded { scene: data, info, .. } = read_file_and(path, limits, decode)?;
        let decode_seconds = begin.elapsed().as_secs_f64();
        let model = DynamicScene::from_arrays(&data, device)?;
        Ok(Self { model, data, info, decode_seconds, backdrop: None, device: device.clone() })
    }

    /// A fit to a frame, and the 8-bit image that it gives.
    fn fitted(&self, fit: &ViewFit, frame: &Frame, truth: &Tensor<3>) -> (Fitted, Tensor<3>) {
        let splatter = self.splatter();
        let (fitted, image) = fit.fit(frame, truth, |camera, time| splatter.render(self.model.at(time), camera, None));
        (fitted, image_tensor(&to_image(image, &frame.camera).to_u8(), &self.device))
    }

    fn splatter(&self) -> Splatter {
        splatter_of(&self.data).with_backdrop(self.backdrop.clone())
    }

    /// Renders a frame's camera at its time; values are clamped to [0, 1].
    pub fn render(&self, frame: &Frame) -> RgbImage32 {
        let rendering = self.splatter().render(self.model.at(frame.time), &frame.camera, None);
        to_image(rendering.image, &frame.camera)
    }

    /// Sections with the header in front.
    pub fn section_sizes(&self) -> Vec<SectionSize> {
        section_sizes(&self.info)
    }

    /// Frames per second over a list of frames, after warm-up.
    fn frames_per_second(&self, frames: &[Frame], eval: &EvalConfig) -> f64 {
        let splatter = self.splatter();
        let draw = |k: usize| {
            let frame = &frames[k % frames.len()];
            let image = splatter.render(self.model.at(frame.time), &frame.camera, None).image;
            // Reading one value waits until the device has finished.
            image.slice([0..1, 0..1, 0..1]).into_scalar::<f32>()
        };
        for k in 0..eval.fps_warmup {
            draw(k);
        }
        let count = eval.fps_frames.max(1);
        let begin = Instant::now();
        for k in 0..count {
            draw(k);
        }
        count as f64 / begin.elapsed().as_secs_f64()
    }

    /// Measures the splits that `eval` names (those that the dataset has). Also returns every rendered view. With `fit`, each view
    /// is measured a second time after a fit of its exposure, pose or time.
    ///
    /// # Errors
    /// [`TrainError::Data`] for weights of LPIPS, an image or a mask that cannot be read.
    ///
    /// # Panics
    /// If the dataset has neither test nor training frames.
    pub fn evaluate(
        &self,
        scene: &Scene,
        images: &dyn ImageSource,
        eval: &EvalConfig,
        fit: Option<&ViewFit>,
        device_name: &str,
    ) -> Result<(Evaluation, Vec<RenderedView>), TrainError> {
        let lpips = Lpips::load(&eval.lpips, &self.device)?;
        let mut splits = Vec::new();
        let mut rendered = Vec::new();
        for name in &eval.splits {
            let split = Split::from(*name);
            let frames = scene.frames(split);
            if frames.is_empty() {
                continue;
            }
            let mut views = Vec::with_capacity(frames.len());
            for frame in frames {
                let render = self.render(frame);
                let truth = images.image(frame)?;
                let image = image_tensor(&render.to_u8(), &self.device);
                let truth_tensor = image_tensor(&truth, &self.device);
                let regions = images.regions(frame)?;
                let scores = Scores::measure(&image, &truth_tensor, &regions, &lpips);
                let fitted = fit.map(|fit| {
                    let (correction, image) = self.fitted(fit, frame, &truth_tensor);
                    FittedScore { scores: Scores::measure(&image, &truth_tensor, &regions, &lpips), correction }
                });
                let (name, time, psnr) = (frame.name.clone(), frame.time, scores.psnr());
                views.push(ViewScore { name: name.clone(), time, scores, fitted });
                let (truth, render) = ((*truth).clone(), render.to_u8());
                rendered.push(RenderedView { split, name, time, psnr, truth, render });
            }
            let scores = Scores::over(views.iter().map(|view| &view.scores));
            let fitted = views.iter().filter_map(|view| Some(&view.fitted.as_ref()?.scores));
            let fitted = fit.map(|_| Scores::over(fitted));
            splits.push(SplitScore { split: name.to_string(), scores, fitted, views });
        }
        let frames = if scene.test.is_empty() { &scene.train } else { &scene.test };
        let camera = frames[0].camera;
        let evaluation = Evaluation {
            device: device_name.to_owned(),
            bytes: self.info.bytes,
            sections: self.section_sizes(),
            gaussians: self.data.gaussians.len(),
            resolution: [camera.width, camera.height],
            fps: self.frames_per_second(frames, eval),
            decode_seconds: self.decode_seconds,
            training_seconds: None,
            splits,
            coding: None,
            advice: Vec::new(),
        };
        Ok((evaluation, rendered))
    }
}

/// An image `[H, W, 3]` of a camera; values are clamped to [0, 1].
fn to_image(image: Tensor<3>, camera: &Camera) -> RgbImage32 {
    let pixels = image.clamp(0.0, 1.0).into_data().iter::<f32>().collect();
    RgbImage32 { width: camera.width, height: camera.height, pixels }
}

/// Sections of a file with the header in front; their sizes add up to that of the file.
pub fn section_sizes(info: &StreamInfo) -> Vec<SectionSize> {
    let header = SectionSize { name: "header".into(), bytes: info.header_bytes };
    let sections = SectionInfo::bytes_by_name(&info.sections).into_iter();
    let sections = sections.map(|(name, bytes)| SectionSize { name: name.to_owned(), bytes });
    std::iter::once(header).chain(sections).collect()
}
