//! How long a capture lasts, from what a transforms file says.

use super::json;
use super::sequence::Sequence;
use crate::duration::usual_step;
use serde_json::Value;
use std::path::Path;

/// A step of time that differs from that of the rate by a larger share is another one.
const OTHER_STEP: f64 = 0.05;

/// Seconds from time 0 to time 1 of a transforms file; `None` where it does not say.
///
/// `seconds` is what `light4gs prepare` writes. `fps`, frames per second, is what other programs write: with it, `times`, those of
/// the frames as the file gives them, are seconds, or whole numbers of frames, or shares of the whole, one step per frame; without
/// times, the numbers in the images' names count frames.
pub(in crate::layouts) fn seconds_of(
    path: &Path,
    document: &Value,
    times: Option<&[f64]>,
    found: &Sequence,
    notes: &mut Vec<String>,
) -> Option<f64> {
    if let Some(seconds) = positive(path, document, "seconds", notes) {
        return Some(seconds);
    }
    let rate = positive(path, document, "fps", notes)?;
    // Where there are no times, those of the names.
    let mut steps: Vec<f64> = match times {
        Some(times) => times.to_vec(),
        None => found.places.iter().map(|place| place.time).collect(),
    };
    steps.sort_by(f64::total_cmp);
    steps.dedup();
    let (first, last) = (*steps.first()?, *steps.last()?);
    let is_whole = steps.iter().all(|time| time.fract() == 0.0);
    let moved: Vec<f32> = steps.iter().map(|time| (time - first) as f32).collect();
    let step = f64::from(usual_step(&moved)?);
    let seconds = match (times, found.intervals) {
        (None, Some(intervals)) => intervals / rate,
        _ if first >= 0.0 && last <= 1.0 => 1.0 / (step * rate),
        _ if (step * rate - 1.0).abs() > OTHER_STEP && is_whole => (last - first) / rate,
        _ => last - first,
    };
    (seconds > 0.0 && seconds.is_finite()).then_some(seconds)
}

/// A positive number of the file. Another value does not keep the capture from being read: it is said and ignored.
fn positive(path: &Path, document: &Value, key: &str, notes: &mut Vec<String>) -> Option<f64> {
    let value = document.get(key).filter(|value| !value.is_null())?;
    let number = value.as_f64().filter(|number| *number > 0.0 && number.is_finite());
    if number.is_none() {
        let found = json::describe(Some(value));
        notes.push(format!("{}: {key} is {found}, no positive number: it is ignored", path.display()));
    }
    number
}
