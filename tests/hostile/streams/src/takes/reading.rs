//! What a take shows at some times, as the codec reads it.

use light4gs_codec::take::{DrawnSegment, SegmentPart, Take, drawn_together};
use light4gs_codec::{CodecError, Decoded, GaussianArrays, Limits, MotionEvaluator, OpenStream, SceneData};

use crate::watch::{Decoder, Outcome};

/// Moving Gaussians takes as long as these and their network need, and both may be large: more are decoded, and not moved.
const MOST_MOVED: usize = 256;
/// Of the base, which does not move.
const MOST_STILL: usize = 1 << 12;

/// What a reader says of one time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// It refuses the take or the segment; with the kind of the error.
    Refused(String),
    /// There are more Gaussians than are asked for here.
    Large,
    /// There are Gaussians.
    Shown(Sums),
}

/// Checksums (CRC-32 as in zlib) of Gaussians, as little-endian `f32`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sums {
    /// Of centers, logarithms of scales, quaternions, logits of opacities, harmonics of degree 0, the others, one behind the other.
    pub all: u32,
    /// Of the centers alone, which do not change where a reader applies the activations.
    pub means: u32,
}

impl Sums {
    /// Of some Gaussians.
    pub fn of(gaussians: &GaussianArrays) -> Self {
        let GaussianArrays { means, log_scales, quats, opacity_logits, sh_dc, sh_rest, .. } = gaussians;
        let mut hasher = crc32fast::Hasher::new();
        let mut add = |values: &[f32]| values.iter().for_each(|value| hasher.update(&value.to_le_bytes()));
        add(means.as_flattened());
        add(log_scales.as_flattened());
        add(quats.as_flattened());
        add(opacity_logits);
        add(sh_dc.as_flattened());
        add(sh_rest);
        let mut of_means = crc32fast::Hasher::new();
        means.as_flattened().iter().for_each(|value| of_means.update(&value.to_le_bytes()));
        Self { all: hasher.finalize(), means: of_means.finalize() }
    }
}

/// The answers for some times, and what they took.
#[derive(Debug)]
pub struct Reading {
    /// One for each time.
    pub answers: Vec<Answer>,
    /// The first fault if there is one, otherwise the last refusal; the most memory and time of the opening or of one time.
    pub outcome: Outcome,
}

impl Reading {
    /// Opens the bytes as a take, and reads what it shows at each time. The index and the base are one part that is watched, and
    /// each time is one.
    pub fn of(bytes: &[u8], times: &[f64], decoder: &Decoder) -> Self {
        let (mut take, mut base) = (None, None);
        let mut most = decoder.watch(|| {
            let opened = take.insert(Take::read(bytes.to_vec(), &Limits::default())?);
            base = Some(base_of(opened)?);
            Ok(())
        });
        let refusal = |answer: &Option<Result<(), CodecError>>| match answer {
            Some(Err(error)) => Answer::Refused(error.kind().to_owned()),
            _ => Answer::Refused("panic".to_owned()),
        };
        let refused = base.is_none().then(|| refusal(&most.answer));
        let Some(take) = take else {
            return Self { answers: vec![refusal(&most.answer); times.len()], outcome: most };
        };
        // A base that is refused must not hide what comes after it: a player may have the segment before.
        let base = base.unwrap_or_default();
        let mut answers = Vec::new();
        for &seconds in times {
            let mut shown = None;
            let outcome = decoder.watch(|| {
                shown = Some(at(&take, &base, seconds)?);
                Ok(())
            });
            answers.push(refused.clone().or(shown).unwrap_or_else(|| refusal(&outcome.answer)));
            most.bytes = most.bytes.max(outcome.bytes);
            most.time = most.time.max(outcome.time);
            if most.fault().is_none() && !matches!(outcome.answer, Some(Ok(()))) {
                most.answer = outcome.answer;
            }
        }
        Self { answers, outcome: most }
    }

    /// Whether something was shown.
    pub fn shows(&self) -> bool {
        self.answers.iter().any(|answer| !matches!(answer, Answer::Refused(_)))
    }
}

/// The Gaussians of the base.
fn base_of(take: &Take) -> Result<GaussianArrays, CodecError> {
    let stream = take.base()?;
    let Decoded { scene, info, .. } = OpenStream::with_limits(&stream, &Limits::default())?.decode()?;
    take.index().check_base(&info)?;
    // Refuses attributes that nothing explains.
    MotionEvaluator::new(&scene)?;
    Ok(scene.gaussians)
}

fn at(take: &Take, base: &GaussianArrays, seconds: f64) -> Result<Answer, CodecError> {
    let mut segments = Vec::new();
    for DrawnSegment { segment, weight } in take.drawn_at(seconds) {
        let segment = take.segment(segment)?;
        let scene: SceneData = OpenStream::with_limits(&segment.stream, &Limits::default())?.decode()?.scene;
        if scene.gaussians.len() > MOST_MOVED {
            return Ok(Answer::Large);
        }
        let evaluator = MotionEvaluator::new(&scene)?;
        let mut moved = scene.gaussians.clone();
        evaluator.apply(&scene.gaussians, segment.times.stream_time(seconds), 0..moved.len(), &mut moved);
        segments.push((segment.hidden, moved, weight));
    }
    if base.len() > MOST_STILL {
        return Ok(Answer::Large);
    }
    let parts = segments.iter().map(|(hidden, moved, weight)| SegmentPart { hidden, moved, weight: *weight });
    Ok(Answer::Shown(Sums::of(&drawn_together(base, &parts.collect::<Vec<_>>()))))
}
