//! The phases that COLMAP does: features, matches, poses. Where few images get a pose, they are done again with more pairs
//! and features.

use super::record::{Phase, Record};
use super::{PrepareEvent, PrepareOptions, frame_names};
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::images::image_size;
use crate::layouts::colmap::{model::Model, read_model};
use crate::layouts::shared::files;
use crate::programs::colmap::{Colmap, Effort, FILM_AGAIN, Job, Mapper};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Up to this many images all pairs are matched, in the first attempt and in the second.
const ALL_PAIRS: [usize; 2] = [24, 90];
/// With more images, those at distances in time that are powers of two: near ones overlap, far ones close loops.
/// In the second attempt, each of so many neighbors as well.
const NEIGHBORS: usize = 12;
/// The pairs are matched in so many parts, for the progress.
const PARTS: usize = 16;
/// Images with a longer side below this number of pixels are doubled in size before features are searched.
const SMALL: u32 = 800;
/// If a smaller share of the images has a pose, there is a second attempt.
pub(super) const LEAST_REGISTERED: f64 = 0.8;
/// If so large a share of the pairs that moved shows nothing but a turn, and there are this many, the camera only turned.
const TURNED: f64 = 0.9;
const LEAST_MOVED: usize = 8;
/// With a smaller parallax, in degrees, there is no depth.
pub(super) const LEAST_PARALLAX: f64 = 1.5;

/// The attempts.
const ATTEMPTS: usize = 2;

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
            sparse: self.folder.join(numbered("sparse")),
            rig,
        }
    }

    /// The model with the most images of all attempts: COLMAP writes one for each group of images that it could connect.
    pub(super) fn best_model(&self) -> Result<Option<Model>, DataError> {
        let mut best: Option<Model> = None;
        for attempt in 0..ATTEMPTS {
            let sparse = self.job(attempt, Vec::new(), false).sparse;
            if !sparse.is_dir() {
                continue;
            }
            for folder in files::entries(&sparse, |path| path.join("images.bin").is_file())? {
                let model = read_model(&folder)?;
                if best.as_ref().is_none_or(|best| model.images.len() > best.images.len()) {
                    best = Some(model);
                }
            }
        }
        Ok(best.filter(|model| model.images.len() >= 2))
    }
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
        let features = if careful { 6000 } else { 1536 };
        let effort = Effort { size: 1600, features, doubled: careful || small };
        let pairs = pairs(&images, ALL_PAIRS[attempt], if attempt == 0 { 0 } else { NEIGHBORS });
        let mapper = if careful || total <= ALL_PAIRS[0] { Mapper::Incremental } else { Mapper::Global };
        attempt_at(&job, effort, &pairs, mapper, colmap, record, tell)?;
        let best = work.best_model()?;
        let registered = best.as_ref().map_or(0, |model| model.images.len());
        let motion = record.motion();
        let turned = motion.moved >= LEAST_MOVED && motion.turned as f64 >= TURNED * motion.moved as f64;
        if turned && best.as_ref().is_none_or(|model| super::write::parallax(model) < LEAST_PARALLAX) {
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

/// One attempt: the phases that it has not done yet.
fn attempt_at(
    job: &Job,
    effort: Effort,
    pairs: &[(&str, &str)],
    mapper: Mapper,
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
        let mut motion = Default::default();
        for part in pairs.chunks(pairs.len().div_ceil(PARTS).max(1)) {
            write_atomically(&list, |out| part.iter().try_for_each(|(a, b)| writeln!(out, "{a} {b}")))?;
            motion = colmap.matches(job, &list)?;
            done += part.len();
            tell(PrepareEvent::progress("matches", done, pairs.len()));
        }
        record.moved(motion);
        record.done(Phase::Matches)?;
    }
    if !record.is_done(Phase::Poses) {
        // The results of a mapper that was stopped are useless.
        if job.sparse.exists() {
            fs::remove_dir_all(&job.sparse).map_err(DataError::io("remove", &job.sparse))?;
        }
        fs::create_dir_all(&job.sparse).map_err(DataError::io("create", &job.sparse))?;
        let mut done = |done: usize| tell(PrepareEvent::progress("poses", done.min(total), total));
        done(0);
        colmap.poses(job, mapper, &mut done)?;
        record.done(Phase::Poses)?;
        let models = files::entries(&job.sparse, |path| path.join("images.bin").is_file())?;
        let counts = models.iter().map(|model| Ok(read_model(model)?.images.len()));
        let most = counts.collect::<Result<Vec<usize>, DataError>>()?.into_iter().max().unwrap_or(0);
        tell(PrepareEvent::Placed { images: most.min(total), total });
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
        let more = pairs(&names, 24, 12);
        assert!(more.contains(&("00", "03")) && more.len() > few.len());
        assert_eq!(pairs(&names, 90, 0).len(), 30 * 29 / 2);
    }
}
