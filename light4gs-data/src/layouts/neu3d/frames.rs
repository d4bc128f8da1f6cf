//! The frames of a rig and their times.
//!
//! Where all frames were taken from videos, the records beside them say when each is shown. Otherwise the number in a
//! name counts time, or, where names have none, the order does.

use super::cameras::{CameraFrames, number_of};
use super::taking::{self, Folder};
use crate::error::DataError;
use crate::images::{ImageHeader, read_headers};
use crate::layouts::shared::files::{self, images, stem_of};
use crate::programs::ffmpeg::Taken;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Up to this share of a camera's pictures may have another size than the others, or no number: they are strays.
const STRAYS: f64 = 0.1;
/// Rates, frames per second, that differ by a larger share are different.
const OTHER_RATE: f64 = 0.01;
/// Videos of different rates must last equally long, up to this factor.
const OTHER_DURATION: f64 = 1.1;

/// A frame of a camera.
#[derive(Debug, PartialEq)]
pub(super) struct RigFrame {
    pub(super) path: PathBuf,
    /// Its number, for its name.
    pub(super) number: usize,
    /// When it is shown, in frames from the first of the rig; a whole number where all cameras have one rate.
    pub(super) instant: f64,
}

/// The frames of a rig.
pub(super) struct Rig {
    /// Those of each camera.
    pub(super) frames: Vec<Vec<RigFrame>>,
    /// Frames per second, where all were taken from videos.
    pub(super) rate: Option<f64>,
}

/// The frames of each camera. Those of videos are extracted first, see [`taking::folder`].
pub(super) fn find(
    root: &Path,
    cameras: &[CameraFrames],
    length: Option<usize>,
    notes: &mut Vec<String>,
) -> Result<Rig, DataError> {
    let folders: Vec<Folder> =
        cameras.par_iter().map(|camera| taking::folder(root, camera, length)).collect::<Result<_, _>>()?;
    let lists = folders.iter().map(|folder| images(&folder.path)).collect::<Result<Vec<_>, _>>()?;
    let records: Vec<Option<Taken>> =
        folders.iter().zip(&lists).map(|(folder, list)| Taken::read(&folder.path, list.len())).collect();
    about_videos(&folders, &records, notes);
    let lists = lists
        .into_iter()
        .zip(cameras)
        .map(|(list, camera)| of_one_size(list, camera, notes))
        .collect::<Result<Vec<_>, _>>()?;
    let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
    if let Some(shorter) = lists.iter().position(|list| list.len() < longest) {
        notes.push(format!(
            "cameras have different numbers of frames: {} has {}, others up to {longest}",
            cameras[shorter].name,
            lists[shorter].len()
        ));
    }
    let records: Option<Vec<Taken>> = records.into_iter().collect();
    let timed = match records.filter(|records| records.iter().zip(&lists).all(|(a, b)| a.seconds.len() == b.len())) {
        Some(records) => by_times(root, &records, length, notes)?,
        None => None,
    };
    Ok(match timed {
        Some(Clock { instants, rate }) => {
            let frames = lists.into_iter().zip(instants).map(|(list, instants)| shown(list, &instants)).collect();
            Rig { frames, rate: Some(rate) }
        }
        None => Rig { frames: by_numbers(lists, notes), rate: None },
    })
}

fn shown(list: Vec<PathBuf>, instants: &[f64]) -> Vec<RigFrame> {
    let frame = |(number, (path, instant)): (usize, (PathBuf, &f64))| RigFrame { path, number, instant: *instant };
    list.into_iter().zip(instants).enumerate().map(frame).collect()
}

/// Notes about the videos, each with the number of videos that it is true of.
fn about_videos(folders: &[Folder], records: &[Option<Taken>], notes: &mut Vec<String>) {
    let mut said: Vec<(&str, &str, usize)> = Vec::new();
    for (folder, record) in folders.iter().zip(records) {
        let Some(record) = record else { continue };
        for note in folder.notes.iter().chain(&record.notes) {
            match said.iter_mut().find(|(known, ..)| known == note) {
                Some((.., others)) => *others += 1,
                None => said.push((note, &record.video, 0)),
            }
        }
    }
    for (note, video, others) in said {
        let more = if others > 0 { format!(" (and {others} others)") } else { String::new() };
        notes.push(format!("{video}{more}: {note}"));
    }
}

/// The pictures of a camera without strays, such as a small preview among the frames.
fn of_one_size(list: Vec<PathBuf>, camera: &CameraFrames, notes: &mut Vec<String>) -> Result<Vec<PathBuf>, DataError> {
    let headers: Vec<ImageHeader> = read_headers(list.par_iter().map(PathBuf::as_path))?;
    let mut counts: HashMap<(u32, u32), usize> = HashMap::new();
    for header in &headers {
        *counts.entry(header.size).or_default() += 1;
    }
    let Some((usual, _)) = counts.into_iter().max_by_key(|(size, count)| (*count, *size)) else { return Ok(list) };
    let most = (STRAYS * list.len() as f64).max(1.0) as usize;
    let strays: Vec<usize> = (0..list.len()).filter(|i| headers[*i].size != usual).collect();
    let Some(first) = strays.first() else { return Ok(without_strays(list, most, notes)) };
    let size = |(width, height): (u32, u32)| format!("{width} x {height}");
    let (found, expected) = (size(headers[*first].size), size(usual));
    if strays.len() > most || list.len() < 3 {
        let problem = format!("it is {found} pixels, but other frames of {} are {expected}", camera.name);
        return Err(DataError::image(
            &list[*first],
            problem,
            "move what is no frame elsewhere, or take the frames again",
        ));
    }
    notes.push(format!(
        "{} of {} pictures of {} left out: {} is {found} pixels, the others are {expected}",
        strays.len(),
        list.len(),
        camera.name,
        list[*first].display()
    ));
    let kept = list.into_iter().enumerate().filter(|(i, _)| !strays.contains(i)).map(|(_, path)| path);
    Ok(without_strays(kept.collect(), most, notes))
}

/// The pictures without the few that have no number, where the others have one.
fn without_strays(list: Vec<PathBuf>, most: usize, notes: &mut Vec<String>) -> Vec<PathBuf> {
    let numbered = |path: &PathBuf| number_of(&stem_of(path)).is_some();
    let strays: Vec<&PathBuf> = list.iter().filter(|path| !numbered(path)).collect();
    let Some(first) = strays.first().filter(|_| strays.len() <= most && list.len() > 2) else { return list };
    let (count, name) = (strays.len(), first.display());
    notes.push(format!("{count} of {} pictures left out: {name} has no number, as the others have", list.len()));
    list.into_iter().filter(numbered).collect()
}

/// The number in a name is the frame's, so that a missing frame does not shift those after it.
fn by_numbers(lists: Vec<Vec<PathBuf>>, notes: &mut Vec<String>) -> Vec<Vec<RigFrame>> {
    let numbers: Option<Vec<Vec<usize>>> =
        lists.iter().map(|list| list.iter().map(|path| number_of(&stem_of(path))).collect()).collect();
    let first = numbers.iter().flatten().flatten().min().copied().unwrap_or(0);
    let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
    let span = numbers.iter().flatten().flatten().max().map_or(0, |last| last - first + 1);
    // Numbers in other names, such as times of day, do not count frames.
    let counted = numbers.filter(|_| span <= 2 * longest.max(1));
    if counted.is_none() {
        let name = lists.iter().flatten().next().map(|path| files::name_of(path)).unwrap_or_default();
        notes.push(format!("names such as {name} do not count frames: the order of the names is taken for time"));
    }
    let number = |camera: usize, i: usize| counted.as_ref().map_or(i, |numbers| numbers[camera][i] - first);
    let of_camera = |(camera, list): (usize, Vec<PathBuf>)| {
        let frame = |(i, path)| RigFrame { path, number: number(camera, i), instant: number(camera, i) as f64 };
        list.into_iter().enumerate().map(frame).collect()
    };
    lists.into_iter().enumerate().map(of_camera).collect()
}

/// When the frames of videos are shown.
struct Clock {
    /// Those of each camera, in frames from the first of the rig.
    instants: Vec<Vec<f64>>,
    /// Frames per second.
    rate: f64,
}

/// The clock of videos that begin at the same time; `None` where there are too few frames to tell a rate.
fn by_times(
    root: &Path,
    records: &[Taken],
    length: Option<usize>,
    notes: &mut Vec<String>,
) -> Result<Option<Clock>, DataError> {
    let mut rates: Vec<f64> = records.iter().map(Taken::rate).collect();
    if rates.contains(&0.0) {
        return Ok(None);
    }
    let of_camera = rates.clone();
    rates.sort_by(f64::total_cmp);
    let rate = rates[rates.len() / 2];
    // Of longer videos only the beginning is used.
    let most = length.map_or(f64::INFINITY, |length| length as f64 / rate);
    let durations: Vec<f64> = records
        .iter()
        .zip(&of_camera)
        .map(|(record, rate)| (record.seconds.last().copied().unwrap_or(0.0) + 1.0 / rate).min(most))
        .collect();
    let usual = of_camera.iter().position(|other| *other == rate).unwrap_or(0);
    let differs = |other: f64| (other / rate - 1.0).abs() > OTHER_RATE;
    let others: Vec<usize> = (0..records.len()).filter(|i| differs(of_camera[*i])).collect();
    let says = |i: usize| format!("{:.2} frames per second in {:.2} s", of_camera[i], durations[i]);
    let ratio = |i: usize| (durations[i] / durations[usual]).max(durations[usual] / durations[i]);
    if let Some(worst) = others.iter().copied().max_by(|a, b| ratio(*a).total_cmp(&ratio(*b))) {
        let (video, reference) = (&records[worst].video, &records[usual].video);
        if ratio(worst) > OTHER_DURATION {
            let problem = format!("it has {}, but {reference} has {}", says(worst), says(usual));
            let remedy = format!(
                "bring all videos to one rate and duration, for example with `ffmpeg -i {video} -r {rate:.2} -t {:.2} \
                 NEW.mp4`, and remove the folders of frames; where frames belong together by their numbers, whatever the \
                 videos say, remove the files frames.json",
                durations[usual]
            );
            return Err(DataError::field(&root.join(video), "video", problem, remedy));
        }
        notes.push(format!(
            "{video} has {}, {reference} has {}: each frame has the time at which it is shown",
            says(worst),
            says(usual)
        ));
    }
    let regular = others.is_empty()
        && records.iter().all(|record| {
            record.seconds.iter().enumerate().all(|(k, seconds)| (seconds * rate - k as f64).abs() < 0.5)
        });
    if !regular && others.is_empty() {
        notes.push("the rate of some videos varies: each frame has the time at which it is shown".to_owned());
    }
    let instant = |(k, seconds): (usize, &f64)| if regular { k as f64 } else { seconds * rate };
    let instants = records.iter().map(|record| record.seconds.iter().enumerate().map(instant).collect()).collect();
    Ok(Some(Clock { instants, rate }))
}
