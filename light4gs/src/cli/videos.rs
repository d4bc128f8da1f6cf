//! What `train` trains on: the folder of a dataset, or videos, from which it makes one first.

use std::path::{Path, PathBuf};

use light4gs_data::{PrepareOptions, prepare};
use light4gs_train::error::TrainError;
use light4gs_train::run::RunFolder;

use super::output::tell;
use super::prepare::Phases;

/// Suffixes of files that lie in datasets, lower case: their folder is meant.
const IN_DATASETS: [&str; 8] = ["json", "npy", "ply", "bin", "txt", "toml", "png", "jpg"];

/// The dataset to train on. Videos are prepared in a folder beside the run, which is kept; one that was begun is continued.
pub(super) fn dataset(named: &[PathBuf], out: &Path, quiet: bool) -> Result<PathBuf, TrainError> {
    let is_video = |path: &PathBuf| {
        let suffix = path.extension().map(|suffix| suffix.to_string_lossy().to_ascii_lowercase());
        path.is_file() && !suffix.is_some_and(|suffix| IN_DATASETS.contains(&suffix.as_str()))
    };
    match named {
        [one] if !is_video(one) => return Ok(one.clone()),
        _ => {}
    }
    if let Some(other) = named.iter().find(|path| !is_video(path)) {
        return Err(TrainError::Input(format!(
            "{} is no video; name one folder of a dataset, or only videos: one of a moving camera, or one for each camera \
             of a rig",
            other.display()
        )));
    }
    let prepared = beside(out);
    let mut phases = Phases::new(quiet);
    let summary = prepare(&PrepareOptions::new(named.to_vec(), prepared.clone()), &mut |event| phases.hear(event))?;
    phases.end();
    tell(format_args!(
        "prepared in {}: {} of {} images have a pose, {:.2} pixels reprojection error, {} points",
        prepared.display(),
        summary.registered,
        summary.images,
        summary.reprojection_error,
        summary.points
    ));
    for advice in summary.advice() {
        tell(format_args!("note: {advice}"));
    }
    Ok(prepared)
}

/// The folder of what was prepared for a run.
fn beside(out: &Path) -> PathBuf {
    let mut name = out.file_name().unwrap_or("run".as_ref()).to_owned();
    name.push("-prepared");
    out.with_file_name(name)
}

/// Whether a run of these videos was begun, so that it is continued and not refused.
pub(super) fn was_begun(scene: &Path, out: &Path) -> bool {
    let absolute = |path: &Path| std::path::absolute(path).ok();
    let begun = scene == beside(out)
        && RunFolder::open(out)
            .is_ok_and(|(_, record, _)| record.dataset().is_ok_and(|dataset| absolute(dataset) == absolute(scene)));
    if begun {
        tell(format_args!(
            "note: {} holds a run of these videos: it is continued as it was configured; --overwrite begins it again",
            out.display()
        ));
    }
    begun
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_stay_and_videos_are_not_mixed_with_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("transforms.json"), "{}").unwrap();
        std::fs::write(path("a.mp4"), "no video").unwrap();
        let run = path("run");
        let of = |named: &[PathBuf]| dataset(named, &run, true);
        assert_eq!(of(&[path("")]).unwrap(), path(""));
        // Errors about these come from the layouts.
        assert_eq!(of(&[path("missing")]).unwrap(), path("missing"));
        assert_eq!(of(&[path("transforms.json")]).unwrap(), path("transforms.json"));
        let mixed = of(&[path("a.mp4"), path("")]).unwrap_err().to_string();
        assert!(mixed.contains("is no video") && mixed.contains("only videos"), "{mixed}");
        assert_eq!(beside(Path::new("runs/walk")), Path::new("runs/walk-prepared"));
        assert_eq!(beside(Path::new("runs/walk/")), Path::new("runs/walk-prepared"));
        assert!(!was_begun(&path("run-prepared"), &run));
    }
}
