//! A take that is shown: its file, or a take in training, whose file is written anew as segments are finished.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use light4gs_codec::Limits;
use light4gs_codec::take::Take;
use light4gs_train::error::TrainError;
use light4gs_train::take::TakeFolder;

/// A take.
#[derive(Debug)]
pub(super) struct TakeSource {
    file: PathBuf,
    /// The folder in which it is trained, if it is shown from there.
    folder: Option<TakeFolder>,
    state: Mutex<TakeState>,
}

/// What the page asks for again and again.
#[derive(Clone, Debug, Default)]
pub(super) struct TakeState {
    /// Number of changes of the file; 0 as long as there is none.
    pub(super) version: u64,
    /// How much is trained, or why there is no newer file; empty if nothing is being trained.
    pub(super) status: String,
    seen: Option<(SystemTime, u64)>,
    joined: Option<Vec<usize>>,
}

impl TakeSource {
    /// The file of a take, within limits.
    ///
    /// # Errors
    /// [`TrainError::Codec`] for a file that is damaged, or cannot be read.
    pub(super) fn file(path: &Path, limits: &Limits) -> Result<Self, TrainError> {
        Take::open(path, limits)?;
        Ok(Self { file: path.to_owned(), folder: None, state: Mutex::default() })
    }

    /// The folder of a take.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a folder that is none.
    pub(super) fn folder(root: &Path) -> Result<Self, TrainError> {
        let folder = TakeFolder::open(root)?;
        Ok(Self { file: folder.file(), folder: Some(folder), state: Mutex::default() })
    }

    /// The file, which may not be there yet.
    pub(super) fn path(&self) -> Arc<Path> {
        Arc::from(self.file.as_path())
    }

    /// The dataset, if it is known.
    pub(super) fn dataset(&self) -> Option<(&TakeFolder, &Path)> {
        self.folder.as_ref().map(|folder| (folder, folder.record().scene.as_path()))
    }

    /// A name for the page.
    pub(super) fn title(&self) -> String {
        let path = self.folder.as_ref().map_or(self.file.as_path(), TakeFolder::root);
        path.file_name().map_or_else(|| "Take".into(), |name| name.to_string_lossy().into_owned())
    }

    /// Joins what is new in the folder, and looks whether the file has changed.
    pub(super) fn newest(&self) -> TakeState {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(folder) = &self.folder {
            state.status = self.join(folder, &mut state).unwrap_or_else(|error| error.to_string());
        }
        let found = std::fs::metadata(&self.file).and_then(|found| Ok((found.modified()?, found.len()))).ok();
        if found.is_some() && found != state.seen {
            state.version += 1;
            state.seen = found;
        }
        state.clone()
    }

    /// Writes the file from the finished segments if there are more of them than in it; says how many there are.
    fn join(&self, folder: &TakeFolder, state: &mut TakeState) -> Result<String, TrainError> {
        if !folder.base().join("scene.l4gs").is_file() {
            return Ok("Waiting for the base".into());
        }
        let trained = folder.trained();
        let all = folder.record().plan.segments.len();
        if state.joined.as_ref() != Some(&trained) {
            let complete = trained.len() == all && self.file.is_file() && self.is_complete(all);
            if !complete {
                folder.join()?;
            }
            state.joined = Some(trained.clone());
        }
        Ok(if trained.len() == all { String::new() } else { format!("{} of {all} segments", trained.len()) })
    }

    /// Whether the file has all segments already; then it is not written again.
    fn is_complete(&self, all: usize) -> bool {
        Take::open(&self.file, &Limits::large()).is_ok_and(|take| take.len() == all)
    }
}
