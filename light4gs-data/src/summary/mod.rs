//! What was understood of a capture, in words, to be looked at before anything is trained.

mod unused;
mod views;

use crate::curves::CameraCurve;
use crate::duration::usual_step;
use crate::error::DataError;
use crate::faults::capture_faults;
use crate::frame::{Frame, MaskMeaning};
use crate::images::hidden_share;
use crate::lens::Distortion;
use crate::scene::{Scene, Split};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use unused::unused;
use views::share_of_points_seen;

/// Masks that are decoded to see whether they leave anything.
const MASKS_READ: usize = 32;
/// Masks that hide a larger share of the pixels are doubtful.
const MOST_HIDDEN: f64 = 0.7;
/// Steps of time longer than this many usual ones are gaps.
const GAP: f32 = 1.5;

/// What a capture is taken for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CaptureSummary {
    /// Facts, in an order in which they are read.
    pub facts: Vec<CaptureFact>,
    /// Notes about reading the folder.
    pub notes: Vec<String>,
    /// What makes the capture hard to learn from, and what to do.
    #[serde(default)]
    pub faults: Vec<String>,
    /// Why training could only fail; empty if it can work.
    pub problems: Vec<String>,
}

/// One line of a [`CaptureSummary`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CaptureFact {
    /// Such as `times`.
    pub what: String,
    /// What was found.
    pub found: String,
}

impl CaptureSummary {
    /// Looks at a scene. A few masks are decoded, and nothing else.
    ///
    /// # Errors
    /// [`DataError::Image`] if one of these masks cannot be read.
    pub fn of(scene: &Scene) -> Result<Self, DataError> {
        let (mut faults, mut problems) = (Vec::new(), Vec::new());
        let facts = [
            ("layout", format!("{}, {}", scene.layout, scene.root.display())),
            ("images", images(scene)),
            ("sizes", sizes(scene)),
            ("cameras", cameras(scene)),
            ("lens", lenses(scene)),
            ("times", times(scene)),
            ("masks", masks(scene, &mut faults, &mut problems)?),
            ("points", points(scene, &mut problems)),
            ("not used", unused(scene)),
        ];
        let facts = facts.into_iter().filter(|(_, found)| !found.is_empty());
        let facts = facts.map(|(what, found)| CaptureFact { what: what.to_owned(), found }).collect();
        Ok(Self { facts, notes: scene.notes.clone(), faults, problems })
    }

    /// Adds what poses and images show, see [`capture_faults`].
    pub fn with_faults(self, scene: &Scene, curves: &[CameraCurve]) -> Self {
        Self { faults: [self.faults, capture_faults(scene, curves)].concat(), ..self }
    }

    /// All facts on one line, for a log.
    pub fn line(&self) -> String {
        self.facts.iter().map(|fact| format!("{}: {}", fact.what, fact.found)).collect::<Vec<_>>().join(" | ")
    }
}

/// Frames with an image, each image once.
fn all(scene: &Scene) -> impl Iterator<Item = &Frame> {
    [Split::Train, Split::Test, Split::Val].into_iter().flat_map(|split| scene.frames(split))
}

fn images(scene: &Scene) -> String {
    let count = |split| scene.frames(split).len();
    format!("{} to train on, {} to test, {} to validate", count(Split::Train), count(Split::Test), count(Split::Val))
}

/// How often each value is there, the most frequent first.
fn counts<T: Ord>(values: impl Iterator<Item = T>) -> Vec<(T, usize)> {
    let mut counts: BTreeMap<T, usize> = BTreeMap::new();
    for value in values {
        *counts.entry(value).or_default() += 1;
    }
    let mut counts: Vec<(T, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts
}

/// The most frequent values with their numbers, as `a`, or as `a (12), b (3), 5 others`.
fn listed(counts: &[(String, usize)]) -> String {
    const LISTED: usize = 3;
    if let [(only, _)] = counts {
        return only.clone();
    }
    let mut parts: Vec<String> = counts.iter().take(LISTED).map(|(what, count)| format!("{what} ({count})")).collect();
    if counts.len() > LISTED {
        parts.push(format!("{} others", counts.len() - LISTED));
    }
    parts.join(", ")
}

fn sizes(scene: &Scene) -> String {
    let size = |frame: &Frame| {
        let (source, used) = ((frame.source_width, frame.source_height), (frame.camera.width, frame.camera.height));
        let used = if used == source { String::new() } else { format!(", used at {} x {}", used.0, used.1) };
        format!("{} x {} pixels{used}", source.0, source.1)
    };
    listed(&counts(all(scene).map(size)))
}

fn cameras(scene: &Scene) -> String {
    let by_camera = counts(all(scene).map(|frame| frame.camera_id));
    let images: Vec<usize> = by_camera.iter().map(|(_, count)| *count).collect();
    let found = match images[..] {
        [] | [_] => "1".to_owned(),
        [most, .., least] if most == least => format!("{} with {most} images each", images.len()),
        [most, .., least] => format!("{} with {least} to {most} images each", images.len()),
    };
    if scene.reading.cameras.is_empty() { found } else { format!("{found} ({})", scene.reading.cameras) }
}

fn lenses(scene: &Scene) -> String {
    let kind = |frame: &Frame| match frame.lens.map(|lens| lens.distortion) {
        None => "pinhole",
        Some(Distortion::RadialTangential { .. }) => "radial and tangential distortion",
        Some(Distortion::BrownConrady { .. }) => "radial distortion of four terms",
        Some(Distortion::Fisheye { .. } | Distortion::ThinPrismFisheye { .. }) => "fisheye",
        Some(Distortion::FieldOfView { .. }) => "distortion by a field of view",
    };
    let angles: Vec<f32> = all(scene).map(|frame| frame.camera.fov().0.to_degrees()).collect();
    let (least, most) = range(&angles);
    let angle = if most - least < 0.05 { format!("{least:.1}") } else { format!("{least:.1} to {most:.1}") };
    let off = |frame: &Frame| {
        let (x, y) = (frame.camera.cx / frame.camera.width as f32, frame.camera.cy / frame.camera.height as f32);
        (x - 0.5).abs().max((y - 0.5).abs())
    };
    let off = all(scene).map(off).fold(0.0, f32::max);
    let off = if off < 0.01 {
        String::new()
    } else {
        format!(", principal point up to {:.0} % of a side off the middle", 100.0 * off)
    };
    let kinds = listed(&counts(all(scene).map(|frame| kind(frame).to_owned())));
    format!("{kinds}, {angle} degrees across{off}")
}

fn range(values: &[f32]) -> (f32, f32) {
    let least = values.iter().copied().fold(f32::INFINITY, f32::min);
    (least, values.iter().copied().fold(f32::NEG_INFINITY, f32::max))
}

fn times(scene: &Scene) -> String {
    let times = scene.times();
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return String::new() };
    let source = if scene.reading.times.is_empty() { String::new() } else { format!(" ({})", scene.reading.times) };
    if times.len() == 1 {
        return format!("1: the scene stands still{source}");
    }
    let usual = usual_step(&times).unwrap_or(1.0);
    let steps = || times.windows(2).map(|pair| (pair[1] - pair[0]) / usual);
    let longest = steps().fold(0.0, f32::max);
    let gaps = match steps().filter(|step| *step > GAP).count() {
        0 => String::new(),
        1 => format!(", 1 gap of {longest:.1} steps"),
        count => format!(", {count} gaps of up to {longest:.1} steps"),
    };
    let seconds = |seconds: f64| format!(" in {:.2} s", seconds * f64::from(last - first));
    let seconds = scene.seconds.map_or_else(String::new, seconds);
    format!("{} from {first} to {last}{seconds}{gaps}{source}", times.len())
}

fn masks(scene: &Scene, faults: &mut Vec<String>, problems: &mut Vec<String>) -> Result<String, DataError> {
    let masked: Vec<&Frame> = all(scene).filter(|frame| frame.mask.is_some()).collect();
    if masked.is_empty() {
        return Ok(String::new());
    }
    let meaning = |frame: &&Frame| match frame.mask.as_ref().map(|mask| mask.zero) {
        Some(MaskMeaning::Moving) => "0 where something moves",
        Some(MaskMeaning::Still) => "0 where nothing moves",
        Some(MaskMeaning::Ignored) | None => "0 is neither trained on nor measured",
    };
    let meanings = listed(&counts(masked.iter().map(|frame| meaning(frame).to_owned())));
    let sample: Vec<&&Frame> = masked.iter().step_by(masked.len().div_ceil(MASKS_READ)).collect();
    let hidden: Vec<f64> = sample.par_iter().map(|frame| hidden_share(frame)).collect::<Result<_, _>>()?;
    let empty = hidden.iter().filter(|share| **share == 1.0).count();
    let mean = hidden.iter().sum::<f64>() / hidden.len() as f64;
    let mut said = String::new();
    if mean > 0.0 {
        said =
            format!(", {:.0} % of the pixels of {} images that were looked at are hidden", 100.0 * mean, sample.len());
    }
    if empty == sample.len() {
        problems.push(format!(
            "the masks hide every pixel, of all {empty} that were looked at: where a mask is 0, nothing is trained; turn them round"
        ));
    } else if mean > MOST_HIDDEN || empty > 0 {
        faults.push(format!(
            "masks hide {:.0} % of the pixels, and all of {empty} of {} images that were looked at: where a mask is 0, nothing is \
             trained; if they mark what shall be seen the other way round, turn them round",
            100.0 * mean,
            sample.len()
        ));
    }
    Ok(format!("{} of {} images, {meanings}{said}", masked.len(), all(scene).count()))
}

fn points(scene: &Scene, problems: &mut Vec<String>) -> String {
    let count = scene.points.len();
    let (seen, looked_at) = share_of_points_seen(&scene.points.positions, &scene.train);
    if seen == 0 {
        problems.push(format!(
            "none of {looked_at} points is in the view of a camera: points and poses have different coordinates, or the poses \
             have other axes than their format says"
        ));
    }
    let of = if looked_at == count { String::new() } else { format!(" of {looked_at} looked at") };
    format!("{count}, {seen}{of} in the view of a camera")
}

#[cfg(test)]
mod damaged;
#[cfg(test)]
mod tests;
