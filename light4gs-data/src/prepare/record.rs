//! A record of the phases that are done, on disk, so that a second call can continue.

use super::{PrepareEvent, PrepareOptions};
use crate::atomic::write_atomically;
use crate::digest::Content;
use crate::error::DataError;
use crate::programs::colmap::Motion;
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
    /// Path and content of each video.
    videos: Vec<(String, Content)>,
    frames: usize,
    max_width: u32,
    moving_rig: bool,
}

impl Settings {
    pub(super) fn of(options: &PrepareOptions) -> Result<Self, DataError> {
        let video = |path: &PathBuf| {
            let place = std::path::absolute(path).map_err(DataError::io("read", path))?;
            Ok((place.to_string_lossy().into_owned(), Content::of(path)?))
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
    /// The attempt at poses, counted from 0.
    #[serde(default)]
    attempt: usize,
    /// The program that finds the poses.
    #[serde(default)]
    poses_by: String,
    #[serde(default)]
    motion: Motion,
    /// What was said on the way.
    #[serde(default)]
    notes: Vec<String>,
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
            let value: serde_json::Value =
                serde_json::from_str(&text).map_err(|source| DataError::Json { path: path.clone(), source })?;
            let contents: Contents = serde_json::from_value(value).map_err(|error| {
                let problem = format!("the folder was begun by another version of the program ({error})");
                DataError::field(&path, "settings", problem, "name another folder, or remove this one")
            })?;
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
        let contents = Contents {
            settings,
            done: Vec::new(),
            attempt: 0,
            poses_by: String::new(),
            motion: Motion::default(),
            notes: Vec::new(),
        };
        let record = Self { path, contents };
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

    /// Keeps a note, and returns it for the caller.
    pub(super) fn note(&mut self, note: String) -> Result<PrepareEvent, DataError> {
        if !self.contents.notes.contains(&note) {
            self.contents.notes.push(note.clone());
            self.save()?;
        }
        Ok(PrepareEvent::Note(note))
    }

    pub(super) fn notes(&self) -> &[String] {
        &self.contents.notes
    }

    pub(super) fn motion(&self) -> Motion {
        self.contents.motion
    }

    pub(super) fn moved(&mut self, motion: Motion) {
        self.contents.motion = motion;
    }

    pub(super) fn attempt(&self) -> usize {
        self.contents.attempt.min(1)
    }

    /// Begins the next attempt at poses.
    pub(super) fn try_again(&mut self) -> Result<(), DataError> {
        self.contents.attempt += 1;
        self.forget_poses()
    }

    /// Notes the program that finds the poses, and returns whether it is another one than that which began.
    pub(super) fn poses_by(&mut self, program: &str) -> Result<bool, DataError> {
        // Poses that are found need no program.
        if self.is_done(Phase::Poses) || self.contents.poses_by == program {
            return Ok(false);
        }
        let other = !self.contents.poses_by.is_empty();
        program.clone_into(&mut self.contents.poses_by);
        self.contents.attempt = 0;
        self.forget_poses()?;
        Ok(other)
    }

    fn forget_poses(&mut self) -> Result<(), DataError> {
        self.contents.done.retain(|phase| *phase == Phase::Frames);
        self.contents.motion = Motion::default();
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
        let video = folder.path().join("a.mp4");
        fs::write(&video, "one").unwrap();
        let options = PrepareOptions { frames: 10, ..PrepareOptions::new(vec![video.clone()], out.clone()) };
        let settings = Settings::of(&options).unwrap();
        let mut record = Record::open(&out, settings.clone()).unwrap();
        assert!(!record.is_done(Phase::Frames));
        record.done(Phase::Frames).unwrap();
        let record = Record::open(&out, settings.clone()).unwrap();
        assert!(record.is_done(Phase::Frames) && !record.is_done(Phase::Poses));
        let other = Record::open(&out, Settings { frames: 11, ..settings.clone() }).err().unwrap().to_string();
        assert!(other.contains("other videos or options"), "{other}");
        // A video of the same name and length.
        fs::write(&video, "two").unwrap();
        assert!(Record::open(&out, Settings::of(&options).unwrap()).is_err());
        // A new attempt keeps the frames, and so does another program.
        let mut record = Record::open(&out, settings.clone()).unwrap();
        assert!(!record.poses_by("COLMAP 3.8").unwrap());
        record.done(Phase::Features).unwrap();
        record.try_again().unwrap();
        assert!(record.is_done(Phase::Frames) && !record.is_done(Phase::Features) && record.attempt() == 1);
        record.done(Phase::Features).unwrap();
        assert!(!record.poses_by("COLMAP 3.8").unwrap() && record.is_done(Phase::Features));
        assert!(record.poses_by("pycolmap 4.2.1").unwrap() && !record.is_done(Phase::Features));
        assert_eq!(record.attempt(), 0);
        fs::write(out.join(FILE), r#"{"settings": {"videos": [["a", 7]]}, "done": []}"#).unwrap();
        let older = Record::open(&out, settings.clone()).err().unwrap().to_string();
        assert!(older.contains("another version"), "{older}");
        fs::write(out.join(FILE), "{").unwrap();
        assert!(Record::open(&out, settings.clone()).err().unwrap().to_string().contains("not valid JSON"));
        fs::remove_file(out.join(FILE)).unwrap();
        fs::write(out.join("thesis.tex"), "x").unwrap();
        assert!(matches!(Record::open(&out, settings), Err(DataError::Exists { .. })));
    }
}
