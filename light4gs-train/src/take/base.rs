//! The base behind a segment: a decoded file of a scene that stands still.

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use light4gs_codec::{GaussianArrays, Limits, read_file_with_limits};
use light4gs_model::Backdrop;

use crate::config::Config;
use crate::error::TrainError;
use crate::run::RunFolder;

/// The file of a run that lists the Gaussians of the base that it hides.
pub const HIDDEN: &str = "hidden.json";

/// The Gaussians of a base.
#[derive(Clone, Debug)]
pub struct Base {
    path: PathBuf,
    gaussians: GaussianArrays,
}

impl Base {
    /// The base that a configuration names, if it names one (`model.base`). A relative path is one from the folder of the run, if
    /// there is a folder: so a run's configuration, and the digest of it in its file, do not depend on where the folder lies.
    ///
    /// # Errors
    /// [`TrainError::Codec`] for a file that cannot be read; [`TrainError::Input`] for a scene that moves.
    pub fn of(config: &Config, folder: Option<&RunFolder>) -> Result<Option<Self>, TrainError> {
        let Some(path) = &config.model.base else { return Ok(None) };
        Self::open(&folder.map_or_else(|| path.clone(), |folder| folder.root().join(path))).map(Some)
    }

    fn open(path: &Path) -> Result<Self, TrainError> {
        let scene = read_file_with_limits(path, &Limits::large())?;
        if !scene.motion.kind.is_empty() || scene.motion.network.is_some() {
            return Err(TrainError::Input(format!(
                "model.base={} is a scene that moves; a base stands still: train it with `--set model.field=still`",
                path.display()
            )));
        }
        Ok(Self { path: path.to_owned(), gaussians: scene.gaussians })
    }

    /// All of its Gaussians.
    pub fn gaussians(&self) -> &GaussianArrays {
        &self.gaussians
    }

    /// Its Gaussians but those at these indices, which rise.
    ///
    /// # Errors
    /// [`TrainError::Input`] for an index beyond the last Gaussian: the indices are of another base.
    pub fn without(&self, hidden: &[u32]) -> Result<GaussianArrays, TrainError> {
        let count = self.gaussians.len();
        let mut shown = vec![true; count];
        for &index in hidden {
            *shown.get_mut(index as usize).ok_or_else(|| {
                TrainError::Input(format!(
                    "{HIDDEN} hides Gaussian {index} of the base {}, which has {count}; was the base trained again? Then \
                     train the segment again, too",
                    self.path.display()
                ))
            })? = false;
        }
        let kept: Vec<u32> = (0..count as u32).filter(|index| shown[*index as usize]).collect();
        Ok(self.gaussians.gathered(&kept))
    }
}

/// What is drawn behind the scene of a run that has begun: the shown part of its base, if it has one.
///
/// # Errors
/// As [`Base::of`] and [`Base::without`]; [`TrainError::Data`] for a damaged list of hidden Gaussians.
pub fn backdrop_of(config: &Config, folder: &RunFolder, device: &Device) -> Result<Option<Backdrop>, TrainError> {
    let Some(base) = Base::of(config, Some(folder))? else { return Ok(None) };
    let hidden: Vec<u32> = folder.read_json(HIDDEN)?.unwrap_or_default();
    Ok(Some(Backdrop::new(&base.without(&hidden)?, device)))
}
