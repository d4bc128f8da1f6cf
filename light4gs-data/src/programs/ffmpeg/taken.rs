//! What the frames of a folder were made from, and when they are shown.

use crate::digest::Content;
use crate::error::DataError;
use crate::regular_file::read_regular_text;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

/// The file beside the frames.
const FILE: &str = "frames.json";
/// A video of ten hours has a line of 20 bytes for each frame.
const MAX_BYTES: u64 = 1 << 26;
/// Longer videos than this many seconds are none.
const LONGEST: f64 = 1e7;

/// Frames that were taken from a video.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Taken {
    /// The name of the video's file.
    pub(crate) video: String,
    /// Its content.
    content: Content,
    /// What was changed on the way, and what is wrong with the video: sentences about `it`.
    pub(crate) notes: Vec<String>,
    /// The time of each frame in seconds; the first is 0, and they increase.
    pub(crate) seconds: Vec<f64>,
}

impl Taken {
    pub(super) fn of(video: &Path, notes: Vec<String>, seconds: Vec<f64>) -> Result<Self, DataError> {
        let name = video.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { video: name, content: Content::of(video)?, notes, seconds })
    }

    /// The record in a folder with `count` frames. `None` where there is none, or where it does not fit the frames.
    pub(crate) fn read(folder: &Path, count: usize) -> Option<Self> {
        let text = read_regular_text(&folder.join(FILE), MAX_BYTES).ok()?;
        let taken: Self = serde_json::from_str(&text).ok()?;
        let orderly = taken.seconds.windows(2).all(|pair| pair[0] < pair[1])
            && taken.seconds.iter().all(|time| (0.0..=LONGEST).contains(time));
        (orderly && taken.seconds.len() == count).then_some(taken)
    }

    /// Writes the record into a folder that nobody else sees yet.
    pub(super) fn write(&self, folder: &Path) -> Result<(), DataError> {
        crate::atomic::write_atomically(&folder.join(FILE), |out| {
            serde_json::to_writer_pretty(&mut *out, self).map_err(Into::into).and_then(|()| out.flush())
        })
    }

    /// Whether this is the video that the frames were made from.
    pub(crate) fn is_of(&self, video: &Path) -> Result<bool, DataError> {
        Ok(Content::of(video)? == self.content)
    }

    /// Removes the frames and the record, so that they can be taken again. A folder that holds anything else is refused.
    pub(crate) fn remove(&self, folder: &Path) -> Result<(), DataError> {
        let read = std::fs::read_dir(folder).map_err(DataError::io("read", folder))?;
        let names: Vec<String> = read.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        let own = |name: &String| {
            let number = name.split_once('.').is_some_and(|(stem, suffix)| {
                (suffix == "png" || suffix == "jpg") && stem.bytes().all(|c| c.is_ascii_digit())
            });
            number || name == FILE || name.starts_with('.')
        };
        if let Some(other) = names.iter().find(|name| !own(name)) {
            let problem = format!("{} was replaced after these frames had been taken from it", self.video);
            let remedy =
                format!("remove the folder; it also holds {other}, so that the program does not do so by itself");
            return Err(DataError::field(folder, "frames", problem, remedy));
        }
        std::fs::remove_dir_all(folder).map_err(DataError::io("remove", folder))
    }

    /// Frames per second in the mean; 0 for a single frame.
    pub(crate) fn rate(&self) -> f64 {
        let last = self.seconds.last().copied().unwrap_or(0.0);
        if last > 0.0 { (self.seconds.len() - 1) as f64 / last } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_record_knows_its_video_and_its_frames() {
        let folder = tempfile::tempdir().unwrap();
        let video = folder.path().join("a.mp4");
        fs::write(&video, "one").unwrap();
        let frames = folder.path().join("frames");
        fs::create_dir(&frames).unwrap();
        let taken = Taken::of(&video, vec![], vec![0.0, 0.5, 2.0]).unwrap();
        taken.write(&frames).unwrap();
        assert_eq!(Taken::read(&frames, 3).as_ref(), Some(&taken));
        assert!(Taken::read(&frames, 2).is_none() && taken.rate() == 1.0);
        assert!(taken.is_of(&video).unwrap());
        fs::write(&video, "two").unwrap();
        assert!(!taken.is_of(&video).unwrap());
        // What it did not make, it does not remove.
        fs::write(frames.join("0000.png"), "").unwrap();
        fs::write(frames.join("thesis.tex"), "").unwrap();
        let message = taken.remove(&frames).unwrap_err().to_string();
        assert!(message.contains("a.mp4 was replaced") && message.contains("thesis.tex"), "{message}");
        fs::remove_file(frames.join("thesis.tex")).unwrap();
        taken.remove(&frames).unwrap();
        assert!(!frames.exists());
        // Records that were edited are none.
        for seconds in ["[0.0, 0.0]", "[1.0, 0.5]", "[0.0, 1e300]", "[-1.0, 0.0]"] {
            fs::create_dir_all(&frames).unwrap();
            let text = fs::read_to_string({
                taken.write(&frames).unwrap();
                frames.join(FILE)
            })
            .unwrap();
            let begin = text.find("\"seconds\"").unwrap();
            fs::write(frames.join(FILE), format!("{}\"seconds\": {seconds} }}", &text[..begin])).unwrap();
            assert!(Taken::read(&frames, 2).is_none(), "{seconds}");
        }
    }
}
