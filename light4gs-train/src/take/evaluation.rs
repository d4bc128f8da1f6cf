//! Measuring a take: quality by frame, at its joins and elsewhere, and flicker.

use burn::tensor::Device;
use light4gs_data::{Frame, RgbImage8, RgbImage32, Scene, Split};
use light4gs_render::PlayableTake;
use serde::Serialize;

use crate::dataset::ImageSource;
use crate::error::TrainError;
use crate::metrics::{image_tensor, psnr, ssim};

/// Frames on each side of a join that count as being at it.
const AT_JOIN: usize = 5;

/// A frame of the dataset, and how the take shows it.
#[derive(Clone, Debug, Serialize)]
pub struct TakeFrame {
    /// Its name.
    pub name: String,
    /// `test` or `train`.
    pub split: String,
    /// Seconds of the take.
    pub seconds: f64,
    /// The segment that shows it.
    pub segment: usize,
    /// Frames to the nearest join; `None` where the take has none.
    pub from_join: Option<usize>,
    /// dB.
    pub psnr: f64,
    /// SSIM.
    pub ssim: f64,
    /// Root mean square over pixels and colors of the error of the change since the frame before, of the same camera, against the
    /// change in the images; `None` for the first frame of a camera.
    pub flicker: Option<f64>,
    /// Whether a join lies between this frame and the one before.
    pub crosses_join: bool,
}

impl TakeFrame {
    /// Whether it is within five frames of a join.
    pub fn is_at_join(&self) -> bool {
        self.from_join.is_some_and(|frames| frames <= AT_JOIN)
    }
}

/// A mean at joins and elsewhere.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct JoinScores {
    /// Over all frames.
    pub all: Option<f64>,
    /// Within five frames of a join; of flicker, across a join.
    pub at_joins: Option<f64>,
    /// Elsewhere.
    pub elsewhere: Option<f64>,
}

/// `eval.json` of a take.
#[derive(Clone, Debug, Serialize)]
pub struct TakeEvaluation {
    /// Size of the file on disk.
    pub bytes: u64,
    /// Segments in the file.
    pub segments: usize,
    /// Bytes of the base.
    pub base_bytes: u64,
    /// Thousands of bytes for a frame of the take that has a segment, base included.
    pub kilobytes_a_frame: f64,
    /// Mean PSNR over the test views, dB.
    pub psnr: JoinScores,
    /// Mean SSIM over the test views.
    pub ssim: JoinScores,
    /// Mean flicker, of 1.
    pub flicker: JoinScores,
    /// Every measured frame, by camera and time.
    pub frames: Vec<TakeFrame>,
}

/// Measures a take on its dataset: the test views, and for flicker consecutive frames of the same camera. Where the test split is
/// a camera of its own, those are its frames; where it is single frames of a moving camera, all frames. Frames that no
/// segment shows are left out.
///
/// # Errors
/// [`TrainError::Codec`] for a damaged segment; [`TrainError::Data`] for an image that cannot be read.
pub fn evaluate_take(
    take: &PlayableTake,
    bytes: u64,
    data: &Scene,
    images: &dyn ImageSource,
    device: &Device,
) -> Result<TakeEvaluation, TrainError> {
    let index = take.take().index();
    let seconds = index.meta().seconds;
    let interval = if index.meta().fps > 0.0 { 1.0 / f64::from(index.meta().fps) } else { 1.0 / 30.0 };
    let joins: Vec<f64> = index.segments().iter().skip(1).map(|segment| segment.times.begin).collect();
    let mut measured = Vec::new();
    let mut before: Option<Shown<'_>> = None;
    for (split, frame) in frames(data) {
        let at = f64::from(frame.time) * seconds;
        let Some(segment) = index.segment_at(at) else {
            before = None;
            continue;
        };
        let shown = Shown {
            frame,
            segment,
            render: render_take(take, frame, data.background)?,
            truth: images.image(frame)?.as_ref().clone(),
        };
        let follows = before.as_ref().filter(|before| before.is_followed_by(frame, interval / seconds));
        let [render, truth] = [&shown.render, &shown.truth].map(|image| image_tensor(image, device));
        let from_join = joins.iter().map(|join| ((at - join) / interval).round().abs() as usize);
        measured.push(TakeFrame {
            name: frame.name.clone(),
            split: split.name().to_owned(),
            seconds: at,
            segment,
            from_join: from_join.min(),
            psnr: psnr(render.clone(), truth.clone()),
            ssim: f64::from(ssim(render, truth).into_scalar::<f32>()),
            flicker: follows.map(|before| before.flicker(&shown)),
            crosses_join: follows.is_some_and(|before| before.segment != segment),
        });
        before = Some(shown);
    }
    let shown: u32 = index.segments().iter().map(|segment| segment.times.frames).sum();
    let is_test = |frame: &&TakeFrame| frame.split == Split::Test.name();
    let quality = |of: fn(&TakeFrame) -> f64| {
        scores(measured.iter().filter(is_test).map(|frame| (of(frame), frame.is_at_join())))
    };
    Ok(TakeEvaluation {
        bytes,
        segments: index.segments().len(),
        base_bytes: index.base().end - index.base().start,
        kilobytes_a_frame: bytes as f64 / 1e3 / f64::from(shown.max(1)),
        psnr: quality(|frame| frame.psnr),
        ssim: quality(|frame| frame.ssim),
        flicker: scores(measured.iter().filter_map(|frame| Some((frame.flicker?, frame.crosses_join)))),
        frames: measured,
    })
}

/// A frame that has been drawn.
struct Shown<'a> {
    frame: &'a Frame,
    segment: usize,
    render: RgbImage8,
    truth: RgbImage8,
}

impl Shown<'_> {
    /// Whether a frame is the next one of the same camera.
    fn is_followed_by(&self, frame: &Frame, interval: f64) -> bool {
        let step = f64::from(frame.time) - f64::from(self.frame.time);
        frame.camera_id == self.frame.camera_id && step > 0.0 && step < 1.5 * interval
    }

    fn flicker(&self, next: &Shown<'_>) -> f64 {
        let change = |to: u8, from: u8| f64::from(to) - f64::from(from);
        let rendered = next.render.pixels.iter().zip(&self.render.pixels);
        let real = next.truth.pixels.iter().zip(&self.truth.pixels);
        let errors = rendered
            .zip(real)
            .map(|((to, from), (real_to, real_from))| (change(*to, *from) - change(*real_to, *real_from)).powi(2));
        (errors.sum::<f64>() / self.render.pixels.len().max(1) as f64).sqrt() / 255.0
    }
}

/// The frames to measure, by camera and time.
fn frames(data: &Scene) -> Vec<(Split, &Frame)> {
    let of = |split: Split| data.frames(split).iter().map(move |frame| (split, frame));
    let is_rig =
        data.test.first().is_some_and(|first| data.train.iter().all(|frame| frame.camera_id != first.camera_id));
    let mut frames: Vec<_> =
        if is_rig { of(Split::Test).collect() } else { of(Split::Test).chain(of(Split::Train)).collect() };
    frames.sort_by(|(_, a), (_, b)| a.camera_id.cmp(&b.camera_id).then(a.time.total_cmp(&b.time)));
    frames
}

/// The image of a take from a frame's camera. The frame's time is a share of the take.
///
/// # Errors
/// [`TrainError::Codec`] for a damaged segment.
pub fn render_take(take: &PlayableTake, frame: &Frame, background: [f32; 3]) -> Result<RgbImage8, TrainError> {
    let seconds = f64::from(frame.time) * take.take().index().meta().seconds;
    let pixels = take.render(&frame.camera, seconds, background)?;
    Ok(RgbImage32 { width: frame.camera.width, height: frame.camera.height, pixels }.to_u8())
}

/// Means over all values, those at joins and the others; `None` where there are none.
fn scores(values: impl Iterator<Item = (f64, bool)>) -> JoinScores {
    let values: Vec<(f64, bool)> = values.collect();
    let mean = |wanted: &dyn Fn(bool) -> bool| {
        let chosen: Vec<f64> = values.iter().filter(|(_, at_join)| wanted(*at_join)).map(|(value, _)| *value).collect();
        (!chosen.is_empty()).then(|| chosen.iter().sum::<f64>() / chosen.len() as f64)
    };
    JoinScores { all: mean(&|_| true), at_joins: mean(&|at_join| at_join), elsewhere: mean(&|at_join| !at_join) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_at_joins_and_elsewhere() {
        let found = scores([(1.0, true), (2.0, false), (6.0, false)].into_iter());
        assert_eq!((found.all, found.at_joins, found.elsewhere), (Some(3.0), Some(1.0), Some(4.0)));
        assert!(scores(std::iter::empty()).all.is_none());
    }
}
