//! The phases that COLMAP does: features, matches, poses. Where few images get a pose, they are done again with more pairs
//! and features.

use super::record::{Phase, Record};
use super::{PrepareEvent, PrepareOptions, frame_names};
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::images::image_size;
use crate::layouts::colmap::{model::Model, read_model};
use crate::layouts::shared::files;
use crate::posing::{LEAST_PARALLAX, LEAST_REGISTERED};
use crate::programs::colmap::{Colmap, Effort, FILM_AGAIN, Job, Mapper, Motion};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Up to this many images all pairs are matched, in the first attempt and in the second.
const ALL_PAIRS: [usize; 2] = [24, 60];
/// With more images, those at distances in time that are powers of two: near ones overlap, far ones close loops.
/// In the second attempt, each of so many neighbors as well.
const NEIGHBORS: usize = 8;
/// The pairs are matched in so many parts, for the progress.
const PARTS: usize = 16;
/// Images with a longer side below this number of pixels are doubled in size before features are searched.
const SMALL: u32 = 800;
/// If so large a share of the pairs that moved shows nothing but a turn, and there are this many, and there is no model of a
/// fair share of the images, the camera only turned.
const TURNED: f64 = 0.5;
const LEAST_MOVED: usize = 8;
const FAIR_SHARE: f64 = 0.4;
/// A model with fewer points than this an image is none: COLMAP has guessed the poses.
const LEAST_POINTS: usize = 8;
/// If more than this share only turned, cameras are placed all at once: that needs less parallax, and takes longer.
const OFTEN_TURNED: f64 = 0.3;

/// The attempts.
const ATTEMPTS: usize = 2;
/// How the names of folders of models begin.
const SPARSE: &str = "sparse";

/// The files of the phases in the folder.
pub(super) struct Work {
    folder: PathBuf,
    images: PathBuf,
}

impl Work {
    pub(super) fn of(out: &Path) -> Self {
        Self { folder: out.join("work"), images: out.join("images") }
    }

    /// What is worked on in an attempt, counted from 0.
    fn job(&self, attempt: usize, names: Vec<String>, rig: bool) -> Job {
        let numbered = |name: &str| if attempt == 0 { name.to_owned() } else { format!("{name}-{}", attempt + 1) };
        Job {
            images: self.images.clone(),
            names,
            list: self.folder.join("images.txt"),
            database: self.folder.join(format!("{}.db", numbered("database"))),
            sparse: self.folder.join(numbered(SPARSE)),
            rig,
        }
    }

    /// The model with the most images of all attempts, if there is one: COLMAP writes one for each group of images that it
    /// could connect.
    pub(super) fn best_model(&self) -> Result<Option<Model>, DataError> {
        let mut best: Option<Model> = None;
        for sparse in files::entries(&self.folder, |path| path.is_dir() && files::name_of(path).starts_with(SPARSE))? {
            let model = best_of(&sparse)?;
            if count(&model) > count(&best) {
                best = model;
            }
        }
        Ok(best)
    }
}

/// The number of images with a pose.
fn count(model: &Option<Model>) -> usize {
    model.as_ref().map_or(0, |model| model.images.len())
}

/// The model with the most images in a folder of models.
fn best_of(sparse: &Path) -> Result<Option<Model>, DataError> {
    let mut best: Option<Model> = None;
    for folder in files::entries(sparse, |path| path.join("images.bin").is_file())? {
        let model = read_model(&folder)?;
        let guessed = model.points.len() < LEAST_POINTS * model.images.len();
        if !guessed && model.images.len() >= 2 && count(&best) < model.images.len() {
            best = Some(model);
        }
    }
    Ok(best)
}

/// The images that need a pose: all images of a moving camera, or the first ones of a rig that stands still.
pub(super) fn posed_images(options: &PrepareOptions, cameras: &[String]) -> Result<Vec<String>, DataError> {
    let lists = frame_names(&options.out, cameras)?;
    if cameras.len() == 1 || options.moving_rig {
        return Ok(lists.into_iter().flatten().collect());
    }
    Ok(lists.into_iter().filter_map(|list| list.into_iter().next()).collect())
}

/// Runs the phases that have not been done yet, and returns the best model.
pub(super) fn reconstruct(
    options: &PrepareOptions,
    cameras: &[String],
    colmap: &Colmap,
    record: &mut Record,
    tell: &mut dyn FnMut(PrepareEvent),
) -> Result<Model, DataError> {
    let work = Work::of(&options.out);
    let images = posed_images(options, cameras)?;
    let total = images.len();
    if total < 2 {
        let problem = format!("{total} image to find poses for, expected at least 2");
        return Err(DataError::field(&work.images, "images", problem, "use a longer video, or more cameras"));
    }
    // Databases of other versions cannot be read.
    if record.poses_by(&colmap.name())? && work.folder.exists() {
        fs::remove_dir_all(&work.folder).map_err(DataError::io("remove", &work.folder))?;
    }
    fs::create_dir_all(&work.folder).map_err(DataError::io("create", &work.folder))?;
    let rig = cameras.len() > 1;
    let small = image_size(&work.images.join(&images[0])).is_ok_and(|(width, height)| width.max(height) < SMALL);
    loop {
        let attempt = record.attempt();
        let job = work.job(attempt, images.clone(), rig);
        write_atomically(&job.list, |out| job.names.iter().try_for_each(|name| writeln!(out, "{name}")))?;
        // A rig that stands still has few images, and needs every point.
        let careful = attempt > 0 || (rig && !options.moving_rig);
        let features = if careful { 4096 } else { 1200 };
        let effort = Effort { size: 1600, features, doubled: small || (careful && total <= ALL_PAIRS[0]) };
        let pairs = pairs(&images, ALL_PAIRS[attempt], if attempt == 0 { 0 } else { NEIGHBORS });
        features_and_matches(&job, effort, &pairs, colmap, record, tell)?;
        if !record.is_done(Phase::Poses) {
            poses(&work, &job, colmap, record.motion(), tell)?;
            record.done(Phase::Poses)?;
        }
        let best = work.best_model()?;
        let registered = count(&best);
        let motion = record.motion();
        if only_turned(&best, total, motion) {
            let share = 100 * motion.turned / motion.moved;
            let problem = format!(
                "the camera only turns: in {share} % of the {} pairs of images that differ much, a turn explains all that \
                 moved, so there is no depth to be found",
                motion.moved
            );
            let remedy = "film again and walk sideways, in an arc around the scene; from one place, film with several \
                          cameras side by side, `light4gs prepare LEFT.mp4 MIDDLE.mp4 RIGHT.mp4 --out DIR`";
            return Err(DataError::field(&work.images, "images", problem, remedy));
        }
        if registered as f64 >= LEAST_REGISTERED * total as f64 || attempt + 1 == ATTEMPTS {
            return best.ok_or_else(|| {
                let problem = format!("{} could not connect any two of the {total} images", colmap.name());
                DataError::field(&work.images, "images", problem, FILM_AGAIN)
            });
        }
        let again = if total <= ALL_PAIRS[attempt + 1] { "all pairs of images" } else { "more pairs of images" };
        tell(
            record.note(format!(
                "{registered} of {total} images got a pose: trying again with {again} and more features"
            ))?,
        );
        record.try_again()?;
    }
}

/// The pairs to match: all of up to `most` images, otherwise those at powers of two in time, and `neighbors`.
fn pairs(images: &[String], most: usize, neighbors: usize) -> Vec<(&str, &str)> {
    let count = images.len();
    let wanted = |distance: usize| count <= most || distance <= neighbors || distance.is_power_of_two();
    let distances = (1..count).filter(|distance| wanted(*distance));
    distances.flat_map(|d| (0..count - d).map(move |i| (images[i].as_str(), images[i + d].as_str()))).collect()
}

/// Whether the motion shows nothing but turns, and there is no model to prove the contrary.
fn only_turned(best: &Option<Model>, total: usize, motion: Motion) -> bool {
    let turned = motion.moved >= LEAST_MOVED && motion.turned as f64 >= TURNED * motion.moved as f64;
    let few = (count(best) as f64) < FAIR_SHARE * total as f64;
    turned && best.as_ref().is_none_or(|model| few || super::write::parallax(model) < LEAST_PARALLAX)
}

/// The first phases of an attempt, if it has not done them yet.
fn features_and_matches(
    job: &Job,
    effort: Effort,
    pairs: &[(&str, &str)],
    colmap: &Colmap,
    record: &mut Record,
    tell: &mut dyn FnMut(PrepareEvent),
) -> Result<(), DataError> {
    let total = job.names.len();
    if !record.is_done(Phase::Features) {
        let mut done = |done: usize| tell(PrepareEvent::progress("features", done.min(total), total));
        done(0);
        colmap.features(job, effort, &mut done)?;
        done(total);
        record.done(Phase::Features)?;
    }
    if !record.is_done(Phase::Matches) {
        let list = job.database.with_extension("pairs.txt");
        tell(PrepareEvent::progress("matches", 0, pairs.len()));
        let mut done = 0;
        let mut motion = Motion::default();
        for part in pairs.chunks(pairs.len().div_ceil(PARTS).max(1)) {
            write_atomically(&list, |out| part.iter().try_for_each(|(a, b)| writeln!(out, "{a} {b}")))?;
            motion = colmap.matches(job, &list)?;
            done += part.len();
            tell(PrepareEvent::progress("matches", done, pairs.len()));
        }
        record.moved(motion);
        record.done(Phase::Matches)?;
    }
    Ok(())
}

/// The poses of an attempt. Where one mapper places few images, the other one is tried.
fn poses(
    work: &Work,
    job: &Job,
    colmap: &Colmap,
    motion: Motion,
    tell: &mut dyn FnMut(PrepareEvent),
) -> Result<(), DataError> {
    let total = job.names.len();
    let often = motion.turned as f64 > OFTEN_TURNED * motion.moved as f64 && motion.moved >= LEAST_MOVED;
    let mappers: &[Mapper] = match (colmap.has(Mapper::Global) && total > ALL_PAIRS[0], often) {
        (false, _) => &[Mapper::Incremental],
        (true, false) => &[Mapper::Incremental, Mapper::Global],
        (true, true) => &[Mapper::Global, Mapper::Incremental],
    };
    for mapper in mappers {
        let suffix = if *mapper == Mapper::Global { "-global" } else { "" };
        let sparse = job.sparse.with_file_name(format!("{}{suffix}", files::name_of(&job.sparse)));
        // The results of a mapper that was stopped are useless.
        if sparse.exists() {
            fs::remove_dir_all(&sparse).map_err(DataError::io("remove", &sparse))?;
        }
        fs::create_dir_all(&sparse).map_err(DataError::io("create", &sparse))?;
        let mut done = |done: usize| tell(PrepareEvent::progress("poses", done.min(total), total));
        done(0);
        colmap.poses(job, &sparse, *mapper, &mut done)?;
        tell(PrepareEvent::Placed { images: count(&best_of(&sparse)?).min(total), total });
        let best = work.best_model()?;
        if count(&best) as f64 >= LEAST_REGISTERED * total as f64 || only_turned(&best, total, motion) {
            break;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_near_in_time_or_all() {
        let names: Vec<String> = (0..30).map(|i| format!("{i:02}")).collect();
        assert_eq!(pairs(&names[..5], 24, 0).len(), 10);
        let few = pairs(&names, 24, 0);
        assert_eq!(few.len(), 29 + 28 + 26 + 22 + 14);
        assert!(few.contains(&("00", "16")) && !few.contains(&("00", "03")));
        let more = pairs(&names, 24, NEIGHBORS);
        assert!(more.contains(&("00", "03")) && more.len() > few.len());
        assert_eq!(pairs(&names, 60, 0).len(), 30 * 29 / 2);
    }
}
