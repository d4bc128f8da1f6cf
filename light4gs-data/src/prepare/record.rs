//! A record of the phases that are done, on disk, so that a second call can continue.

use super::PrepareOptions;
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::regular_file::read_regular_text;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The file in the prepared folder.
const FILE: &str = "prepare.json";
/// The file has only a few lines.
const MAX_BYTES: u64 = 1 << 20;

/// A phase that need not be done again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Phase {
    Frames,
    Features,
    Matches,
    Poses,
    Dataset,
}

/// The settings on which the phases depend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Settings {
    /// Path and bytes of each video.
    videos: Vec<(String, u64)>,
    frames: usize,
    max_width: u32,
    moving_rig: bool,
}

impl Settings {
    pub(super) fn of(options: &PrepareOptions) -> Result<Self, DataError> {
        let video = |path: &PathBuf| {
            let length = fs::metadata(path).map_err(DataError::io("read", path))?.len();
            let place = std::path::absolute(path).map_err(DataError::io("read", path))?;
            Ok((place.to_string_lossy().into_owned(), length))
        };
        Ok(Self {
            videos: options.videos.iter().map(video).collect::<Result<_, DataError>>()?,
            frames: options.frames,
            max_width: options.max_width,
            moving_rig: options.moving_rig,
        })
    }
}

#[derive(Serialize, Deserialize)]
struct Contents {
    settings: Settings,
    done: Vec<Phase>,
}

/// The record of a folder.
pub(super) struct Record {
    path: PathBuf,
    contents: Contents,
}

impl Record {
    /// The record of the folder `out`, which is made if it does not exist. A folder with other settings is refused, and
    /// so is one that holds something else.
    pub(super) fn open(out: &Path, settings: Settings) -> Result<Self, DataError> {
        let path = out.join(FILE);
        if path.exists() {
            let text = read_regular_text(&path, MAX_BYTES).map_err(DataError::io("read", &path))?;
            let contents: Contents =
                serde_json::from_str(&text).map_err(|source| DataError::Json { path: path.clone(), source })?;
            if contents.settings != settings {
                return Err(DataError::field(
                    &path,
                    "settings",
                    "the folder was begun with other videos or options",
                    "give the same ones to go on, or name another folder",
                ));
            }
            return Ok(Self { path, contents });
        }
        let taken = out.exists() && fs::read_dir(out).map_err(DataError::io("read", out))?.next().is_some();
        if taken {
            return Err(DataError::Exists { path: out.to_path_buf() });
        }
        fs::create_dir_all(out).map_err(DataError::io("create", out))?;
        let record = Self { path, contents: Contents { settings, done: Vec::new() } };
        record.save()?;
        Ok(record)
    }

    pub(super) fn is_done(&self, phase: Phase) -> bool {
        self.contents.done.contains(&phase)
    }

    pub(super) fn done(&mut self, phase: Phase) -> Result<(), DataError> {
        if !self.is_done(phase) {
            self.contents.done.push(phase);
        }
        self.save()
    }

    fn save(&self) -> Result<(), DataError> {
        write_atomically(&self.path, |out| {
            serde_json::to_writer_pretty(&mut *out, &self.contents).map_err(Into::into).and_then(|()| out.flush())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_goes_on_with_the_same_settings_only() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let settings = Settings { videos: vec![("a.mp4".into(), 7)], frames: 10, max_width: 100, moving_rig: false };
        let mut record = Record::open(&out, settings.clone()).unwrap();
        assert!(!record.is_done(Phase::Frames));
        record.done(Phase::Frames).unwrap();
        let record = Record::open(&out, settings.clone()).unwrap();
        assert!(record.is_done(Phase::Frames) && !record.is_done(Phase::Poses));
        let other = Record::open(&out, Settings { frames: 11, ..settings.clone() }).err().unwrap().to_string();
        assert!(other.contains("other videos or options"), "{other}");
        fs::write(out.join(FILE), "{").unwrap();
        assert!(Record::open(&out, settings.clone()).err().unwrap().to_string().contains("not valid JSON"));
        fs::remove_file(out.join(FILE)).unwrap();
        fs::write(out.join("thesis.tex"), "x").unwrap();
        assert!(matches!(Record::open(&out, settings), Err(DataError::Exists { .. })));
    }
}
