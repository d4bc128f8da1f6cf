//! The phases that COLMAP does: features, matches, poses.

use super::record::{Phase, Record};
use super::{PrepareOptions, PrepareProgress, frame_names};
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::layouts::colmap::read_model;
use crate::layouts::shared::files;
use crate::programs::colmap::{Step, counted, path_argument, registered, run};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Up to this many images all pairs are matched; with more images, neighbors in time.
const EXHAUSTIVE: usize = 30;
/// Number of neighbors in time that are matched; further ones at distances of powers of two.
const OVERLAP: usize = 10;
/// Features of an image: half of COLMAP's default, so that matching on a CPU takes a quarter of the time.
const FEATURES: usize = 4096;

/// COLMAP's files in the folder.
pub(super) struct Work {
    images: PathBuf,
    list: PathBuf,
    database: PathBuf,
    sparse: PathBuf,
}

impl Work {
    pub(super) fn of(out: &Path) -> Self {
        let work = out.join("work");
        Self {
            images: out.join("images"),
            list: work.join("images.txt"),
            database: work.join("database.db"),
            sparse: work.join("sparse"),
        }
    }

    /// The model with the most images: COLMAP writes one for each group of images that it could connect.
    pub(super) fn best_model(&self) -> Result<PathBuf, DataError> {
        let models = files::entries(&self.sparse, |path| path.join("images.bin").is_file())?;
        let mut counted = Vec::with_capacity(models.len());
        for model in models {
            counted.push((read_model(&model)?.images.len(), model));
        }
        counted.into_iter().max_by_key(|(count, _)| *count).map(|(_, model)| model).ok_or_else(|| {
            DataError::field(&self.sparse, "models", "0 found, expected at least one", "begin again in another folder")
        })
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

/// Runs the phases that have not been done yet.
pub(super) fn reconstruct(
    options: &PrepareOptions,
    cameras: &[String],
    record: &mut Record,
    progress: &mut dyn FnMut(PrepareProgress),
) -> Result<(), DataError> {
    let work = Work::of(&options.out);
    let images = posed_images(options, cameras)?;
    let total = images.len();
    if total < 2 {
        let problem = format!("{total} image to find poses for, expected at least 2");
        return Err(DataError::field(&work.images, "images", problem, "use a longer video, or more cameras"));
    }
    let folder = options.out.join("work");
    fs::create_dir_all(&folder).map_err(DataError::io("create", &folder))?;
    write_atomically(&work.list, |out| images.iter().try_for_each(|name| writeln!(out, "{name}")))?;
    if !record.is_done(Phase::Features) {
        features(&work, cameras.len() > 1, total, progress)?;
        record.done(Phase::Features)?;
    }
    if !record.is_done(Phase::Matches) {
        matches(&work, cameras.len() > 1, total, progress)?;
        record.done(Phase::Matches)?;
    }
    if !record.is_done(Phase::Poses) {
        poses(&work, total, progress)?;
        record.done(Phase::Poses)?;
    }
    Ok(())
}

/// A function that reports the progress that a line shows.
fn counting<'a>(
    phase: &'static str,
    total: usize,
    progress: &'a mut dyn FnMut(PrepareProgress),
    count: impl Fn(&str) -> Option<usize> + 'a,
) -> impl FnMut(&str) + 'a {
    progress(PrepareProgress { phase, done: 0, total });
    move |line| {
        if let Some(done) = count(line) {
            progress(PrepareProgress { phase, done: done.min(total), total });
        }
    }
}

fn features(work: &Work, rig: bool, total: usize, progress: &mut dyn FnMut(PrepareProgress)) -> Result<(), DataError> {
    let step = Step {
        command: "feature_extractor",
        gpu_groups: &["SiftExtraction", "FeatureExtraction"],
        attempt: "finding features",
        remedy: "remove the folder `work` in the output and try again",
    };
    let arguments = |command: &mut std::process::Command| {
        path_argument(command, "--database_path", &work.database);
        path_argument(command, "--image_path", &work.images);
        path_argument(command, "--image_list_path", &work.list);
        // A phone's lens needs two coefficients. From the single image of a rig's camera only one can be estimated.
        command.args(["--ImageReader.camera_model", if rig { "SIMPLE_RADIAL" } else { "OPENCV" }]);
        let cameras = if rig { "--ImageReader.single_camera_per_folder" } else { "--ImageReader.single_camera" };
        command.args([cameras, "1"]);
        command.args(["--SiftExtraction.max_num_features", &FEATURES.to_string()]);
    };
    run(&step, arguments, &mut counting("features", total, progress, |line| Some(counted(line)?.0)))
}

fn matches(work: &Work, rig: bool, total: usize, progress: &mut dyn FnMut(PrepareProgress)) -> Result<(), DataError> {
    let all_pairs = rig || total <= EXHAUSTIVE;
    let step = Step {
        command: if all_pairs { "exhaustive_matcher" } else { "sequential_matcher" },
        gpu_groups: &["SiftMatching", "FeatureMatching"],
        attempt: "matching features",
        remedy: "remove the folder `work` in the output and try again",
    };
    let arguments = |command: &mut std::process::Command| {
        path_argument(command, "--database_path", &work.database);
        if !all_pairs {
            command.args(["--SequentialMatching.overlap", &OVERLAP.to_string()]);
        }
    };
    // With all pairs COLMAP counts blocks, with neighbors it counts images.
    let count = move |line: &str| {
        let (done, of) = counted(line)?;
        Some(if of == total { done } else { total * done.saturating_sub(1) / of.max(1) })
    };
    run(&step, arguments, &mut counting("matches", total, progress, count))
}

fn poses(work: &Work, total: usize, progress: &mut dyn FnMut(PrepareProgress)) -> Result<(), DataError> {
    // The results of a mapper that was stopped are useless.
    if work.sparse.exists() {
        fs::remove_dir_all(&work.sparse).map_err(DataError::io("remove", &work.sparse))?;
    }
    fs::create_dir_all(&work.sparse).map_err(DataError::io("create", &work.sparse))?;
    let remedy = "film again: move sideways, slowly, past something with texture (see docs/data.md)";
    let step = Step { command: "mapper", gpu_groups: &[], attempt: "finding poses", remedy };
    let arguments = |command: &mut std::process::Command| {
        path_argument(command, "--database_path", &work.database);
        path_argument(command, "--image_path", &work.images);
        path_argument(command, "--output_path", &work.sparse);
    };
    run(&step, arguments, &mut counting("poses", total, progress, registered))?;
    if files::entries(&work.sparse, |path| path.join("images.bin").is_file())?.is_empty() {
        let colmap = crate::programs::colmap::COLMAP;
        return Err(colmap.error("no two of the images could be connected", remedy));
    }
    Ok(())
}
