//! A take: frames and segments, one after the other, so that memory does not grow with its length.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

use light4gs_codec::take::{SegmentPart, SegmentPlace, Take, TakeIndex, TakeSegment, drawn_together};
use light4gs_codec::{CodecError, GaussianArrays, Limits, OpenStream, SceneData};
use light4gs_data::{
    GaussianPly, GlbOptions, MotionSample, NumberedFiles, write_atomically, write_four_dgs, write_glb,
};
use light4gs_model::{BuiltInField, DynamicScene, STILLNESS};
use light4gs_render::PlayableTake;
use light4gs_train::device;
use light4gs_train::error::TrainError;
use serde_json::{Value, json};

use super::super::limits::most::MOST_FRAMES;
use super::super::output::say;
use super::Export;
use super::plain::{left_out, left_out_names, plain_gaussians};
use super::skin::{Distances, NodesMotion};
use super::target::{Target, write_ply_archive, write_ply_folder};

/// What stands still, in a folder of glTF files.
const BASE: &str = "base.glb";
/// When each of these files is shown.
const SEGMENTS: &str = "segments.json";
/// A frame that is nearer to a join than this share of a frame is the first one behind it: times are rounded.
const ROUNDING: f64 = 1e-3;

/// The frames of a take.
struct Frames<'a> {
    index: &'a TakeIndex,
    fps: f64,
    count: u32,
}

impl<'a> Frames<'a> {
    /// All frames from second 0 on: to the end of the last segment, or to the last second of the take where its end has no segment.
    fn of(index: &'a TakeIndex, fps: f64) -> Result<Self, TrainError> {
        let seconds = index.meta().seconds;
        let end = index.segments().last().map_or(0.0, |last| last.times.end);
        let is_covered = end > 0.0 && end >= seconds;
        let count =
            if is_covered { (end * fps - ROUNDING).ceil() } else { (seconds * fps + ROUNDING).floor() + 1.0 }.max(1.0);
        if count > MOST_FRAMES.into() {
            return Err(TrainError::Input(format!(
                "the take has {count} frames of {fps} a second, more than {MOST_FRAMES}; give fewer a second with --fps"
            )));
        }
        Ok(Self { index, fps, count: count as u32 })
    }

    fn numbers(&self) -> std::ops::Range<usize> {
        0..self.count as usize
    }

    /// The seconds of a frame.
    fn seconds(&self, frame: usize) -> f64 {
        let seconds = frame as f64 / self.fps;
        match self.segment(frame) {
            Some(segment) => seconds.max(self.index.segments()[segment].times.begin),
            None => seconds,
        }
    }

    /// The segment that is shown in a frame.
    fn segment(&self, frame: usize) -> Option<usize> {
        let seconds = frame as f64 / self.fps;
        let soon = self.index.segment_at(seconds + ROUNDING / self.fps);
        soon.or_else(|| self.index.segment_at(seconds))
    }

    /// A text that says in how many frames there is no segment.
    fn without_segment(&self) -> String {
        let count = self.numbers().filter(|frame| self.segment(*frame).is_none()).count();
        let all = self.count;
        if count == 0 {
            String::new()
        } else {
            format!("; {count} of the {all} frames have no segment, so nothing moves in them")
        }
    }
}

impl Export {
    pub(super) fn export_take(&self, path: &Path, target: Target) -> Result<(), TrainError> {
        self.refuse_options_of_clips()?;
        let limits = self.limits.get();
        let single_time = matches!(target, Target::Ply | Target::Glb);
        if !single_time && (self.at.is_some() || self.base) {
            let option = if self.base { "--base" } else { "--at" };
            return Err(TrainError::Input(format!(
                "{option} is one time of a take; name a .ply or .glb file with --out"
            )));
        }
        if self.base {
            let take = PlayableTake::new(Take::open_front(&self.file, &limits)?, &limits)?;
            return self.write_single(path, target, take.base().at(0.0)?);
        }
        let take = PlayableTake::open(&self.file, &limits).map_err(|error| self.with_remedy(error, &limits))?;
        let index = take.take().index();
        let out = path.display();
        if single_time {
            let none_named = self.at.is_none() && target == Target::Glb;
            if none_named {
                return Err(TrainError::Input(format!(
                    "--out {out}: a take is a .glb file for each segment, so that a program loads them one after the other; name a \
                     folder and give --to glb, or a single time with --at SECONDS or --base"
                )));
            }
            let seconds = self.at.unwrap_or(0.0);
            if !(0.0..=index.seconds()).contains(&seconds) {
                let most = index.seconds();
                return Err(TrainError::Input(format!(
                    "--at must be 0 to {most:.2}, the seconds of the take, not {seconds}"
                )));
            }
            return self.write_single(path, target, take.at(seconds)?);
        }
        if target == Target::GlbSegments {
            return self.write_segments(path, &take, &limits);
        }
        let frames = Frames::of(index, self.fps(index.meta().fps)?)?;
        let at =
            |frame: usize| -> Result<GaussianPly, TrainError> { Ok(plain_gaussians(take.at(frames.seconds(frame))?)) };
        match target {
            Target::PlySequence => write_ply_folder(path, frames.numbers().map(at))?,
            Target::PlyZip => write_ply_archive(path, frames.numbers().map(at))?,
            _ => {
                let samples = frames.numbers().map(|frame| {
                    let anew = frame == 0 || frames.segment(frame) != frames.segment(frame - 1);
                    Ok::<_, TrainError>(MotionSample { begin: frame as f64 / frames.fps, anew, gaussians: at(frame)? })
                });
                let first = index.segments().first().map_or(0.0, |segment| segment.times.begin);
                let typical = plain_gaussians(take.at(first)?);
                write_four_dgs(path, &typical, samples, f64::from(frames.count) / frames.fps)?;
                say(format_args!("wrote {out} ({} samples)", frames.count))?;
            }
        }
        let fps = frames.fps;
        say(format_args!(
            "{:.2} seconds, {fps} frames per second{}",
            f64::from(frames.count) / fps,
            frames.without_segment()
        ))
    }

    fn refuse_options_of_clips(&self) -> Result<(), TrainError> {
        let (option, remedy) = match () {
            () if self.time.is_some() => ("--time", "--at SECONDS"),
            () if self.frames.is_some() => ("--frames", "--fps"),
            () => return Ok(()),
        };
        let file = self.file.display();
        Err(TrainError::Input(format!(
            "{file} is a take, whose times are in seconds: give {remedy} instead of {option}"
        )))
    }

    /// The error of a file that cannot be opened as a whole, with a hint where its base is there.
    fn with_remedy(&self, error: CodecError, limits: &Limits) -> TrainError {
        let front_is_there =
            error.kind() == "truncated" && Take::open_front(&self.file, limits).is_ok_and(|front| front.base().is_ok());
        if front_is_there {
            TrainError::Input(format!("{error}; its base is there, and --base writes it"))
        } else {
            error.into()
        }
    }

    fn write_single(&self, path: &Path, target: Target, gaussians: GaussianArrays) -> Result<(), TrainError> {
        let (count, left_out) = (gaussians.len(), left_out([&gaussians], &[]));
        let options = GlbOptions { sh_degree: gaussians.sh_degree, z_is_up: self.z_up };
        let gaussians = plain_gaussians(gaussians);
        let left_out = if target == Target::Glb {
            write_glb(path, &gaussians, None, &options)?;
            left_out
        } else {
            gaussians.write(path)?;
            String::new()
        };
        say(format_args!("wrote {} ({count} Gaussians){left_out}", path.display()))
    }

    /// A glTF file for the base, one for each segment, and the list of them.
    fn write_segments(&self, folder: &Path, take: &PlayableTake, limits: &Limits) -> Result<(), TrainError> {
        let index = take.take().index();
        let names = NumberedFiles::new(index.segments().len(), "glb");
        names.open_folder(folder)?;
        let still = take.base().at(0.0)?;
        // glTF has no empty lists.
        let base = (!still.is_empty()).then_some(BASE);
        if let Some(name) = base {
            let options = GlbOptions { sh_degree: still.sh_degree, z_is_up: self.z_up };
            write_glb(&folder.join(name), &plain_gaussians(still.clone()), None, &options)?;
        }
        let fps = self.fps(index.meta().fps)?;
        let device = device::open(self.device)?;
        let mut report = SegmentsReport::default();
        let mut list: Vec<Value> = Vec::new();
        for (number, place) in index.segments().iter().enumerate() {
            let TakeSegment { times, stream, hidden } = take.take().segment(number)?;
            let of_segment = |error| CodecError::InTake { part: format!("segment {number}"), error: Box::new(error) };
            let decoded =
                OpenStream::with_limits(&stream, limits).and_then(|stream| stream.decode()).map_err(of_segment)?;
            let data: SceneData = decoded.scene;
            let scene: DynamicScene = DynamicScene::from_arrays(&data, &device)?;
            let name = names.name(number);
            let path = folder.join(&name);
            // Alone: a file of its own has no other segment to fade into.
            let alone = |moved| SegmentPart { hidden: &hidden, moved, weight: 1.0 };
            let drawn = drawn_together(&still, &[alone(&data.gaussians)]);
            let options = GlbOptions { sh_degree: drawn.sh_degree, z_is_up: self.z_up };
            let standing = drawn.len() - data.gaussians.len();
            let keyframes = Keyframes::of(place, fps);
            let time = |moment: f32| times.stream_time(times.begin + f64::from(moment) / keyframes.fps);
            let nodes = match &scene.field {
                BuiltInField::Nodes(nodes) if !data.gaussians.is_empty() => Some(nodes),
                _ => None,
            };
            if let Some(nodes) = nodes {
                let (keyframes, fps) = (keyframes.count, keyframes.fps);
                let motion = NodesMotion { scene: &scene, nodes, keyframes, fps, time: &time, standing };
                let skin = motion.skin()?;
                write_glb(&path, &plain_gaussians(drawn), Some(&skin), &options)?;
                motion.add_distances(&skin, &mut report.distances);
                report.moving += 1;
            } else {
                let moment = drawn_together(&still, &[alone(&scene.at(time(0.0)).to_arrays())]);
                write_glb(&path, &plain_gaussians(moment), None, &options)?;
                report.standing += usize::from(!data.gaussians.is_empty());
            }
            let further = data.gaussians.further.iter().map(|attribute| attribute.name.clone());
            report.left_out.extend(further.filter(|name| nodes.is_none() || name != STILLNESS));
            list.push(json!({"file": name, "begin": times.begin, "end": times.end}));
        }
        let meta = index.meta();
        let text =
            json!({"name": meta.name, "fps": meta.fps, "seconds": index.seconds(), "base": base, "segments": list});
        write_atomically(&folder.join(SEGMENTS), |file| writeln!(file, "{text:#}"))?;
        say(format_args!("wrote {} segments to {}{}", list.len(), folder.display(), report.text()))
    }
}

/// What is said of the files of segments.
#[derive(Default)]
struct SegmentsReport {
    /// Segments whose motion is in their file.
    moving: usize,
    /// Segments of one time, since their motion is not one of nodes.
    standing: usize,
    distances: Distances,
    left_out: BTreeSet<String>,
}

impl SegmentsReport {
    fn text(&self) -> String {
        let mut text = String::new();
        if self.moving > 0 {
            text += &format!(" ({})", self.distances);
        }
        if self.standing > 0 {
            text += &format!(", {} of them without their motion, which no control nodes have", self.standing);
        }
        text + &left_out_names(self.left_out.iter().map(String::as_str))
    }
}

/// The keyframes of a segment: at its begin, at its end, and at equal distances between them.
struct Keyframes {
    count: u32,
    /// Keyframes per second, near to those that were asked for.
    fps: f64,
}

impl Keyframes {
    fn of(place: &SegmentPlace, fps: f64) -> Self {
        let seconds = place.times.end - place.times.begin;
        let intervals = (seconds * fps).round().clamp(1.0, (MOST_FRAMES - 1).into());
        Self { count: intervals as u32 + 1, fps: intervals / seconds }
    }
}

#[cfg(test)]
mod tests {
    use light4gs_codec::encode;
    use light4gs_codec::take::{NewSegment, SegmentTimes, TakeMeta, write_take};

    use super::*;

    /// A take with segments from and to these seconds.
    fn take(seconds: f64, segments: &[(f64, f64)]) -> Take {
        let stream = encode(&SceneData::default()).unwrap();
        let segment = |&(begin, end): &(f64, f64)| NewSegment {
            times: SegmentTimes { begin, end, stream_begin: begin, stream_end: end, frames: 0 },
            stream: stream.clone(),
            hidden: Vec::new(),
        };
        let segments: Vec<NewSegment> = segments.iter().map(segment).collect();
        let meta = TakeMeta { seconds, ..TakeMeta::default() };
        Take::read(write_take(&meta, &stream, &segments, 0).unwrap(), &Limits::default()).unwrap()
    }

    #[test]
    fn frames_are_those_of_the_take_wherever_its_segments_end() {
        let count = |seconds, segments: &[(f64, f64)], fps| {
            Frames::of(take(seconds, segments).index(), fps).map(|frames| frames.count).unwrap()
        };
        // From the first of 30 frames to the last there are 2.9 seconds; the last one is shown until second 3.
        assert_eq!(count(2.9, &[(0.0, 1.5), (1.5, 3.0)], 10.0), 30);
        assert_eq!(count(2.9, &[(0.0, 1.5)], 10.0), 30, "the second half is not trained");
        assert_eq!(count(2.9, &[], 10.0), 30);
        assert_eq!(count(0.0, &[], 10.0), 1);
        assert_eq!(count(3.0, &[(0.0, 3.0)], 10.0), 30);
        // 30000/1001 frames per second, in float32.
        let fps = f64::from(30_000.0_f32 / 1001.0);
        assert_eq!(count(0.0, &[(0.0, 1800.0 * 1001.0 / 30_000.0)], fps), 1800);
        assert!(Frames::of(take(1e6, &[]).index(), 30.0).is_err_and(|error| error.to_string().contains("--fps")));
    }

    #[test]
    fn a_frame_at_a_join_is_the_first_of_its_segment() {
        let third = 1.0 / 3.0;
        let take = take(0.0, &[(0.0, third + 1e-9), (third + 1e-9, 0.7), (1.0, 2.0)]);
        let frames = Frames::of(take.index(), 30.0).unwrap();
        let segments = [9, 10, 20, 21, 29, 30, 59].map(|frame| frames.segment(frame));
        assert_eq!(segments, [Some(0), Some(1), Some(1), None, None, Some(2), Some(2)]);
        assert_eq!((frames.count, frames.seconds(10)), (60, third + 1e-9));
        assert_eq!(frames.seconds(11), 11.0 / 30.0);
        assert!(frames.without_segment().contains("9 of the 60 frames"));
    }

    #[test]
    fn keyframes_begin_and_end_with_the_segment() {
        let take = take(0.0, &[(1.0, 2.04)]);
        let keyframes = Keyframes::of(&take.index().segments()[0], 10.0);
        assert_eq!(keyframes.count, 11);
        assert!((f64::from(keyframes.count - 1) / keyframes.fps - 1.04).abs() < 1e-12);
    }
}
