//! Poses of images, through COLMAP: its program, or its Python package.
//!
//! Programs of version 4 and the package have a faster matcher than the older ones that Linux distributions install, and a
//! mapper that places all cameras at once. So a new program comes first, then the package, then any program.

mod program;
mod python;

pub(crate) use program::COLMAP;

use crate::error::DataError;
use std::path::{Path, PathBuf};

/// The version of the program since which it is preferred to the package.
const NEW: (u32, u32) = (4, 0);

/// COLMAP, as it was found on this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Colmap {
    /// The program, with its version.
    Program((u32, u32)),
    /// The package `pycolmap`, with its version.
    Package(String),
}

/// What is worked on.
pub(crate) struct Job {
    /// The folder of the images.
    pub(crate) images: PathBuf,
    /// The images, relative to that folder.
    pub(crate) names: Vec<String>,
    /// A file with a name a line.
    pub(crate) list: PathBuf,
    /// COLMAP's database.
    pub(crate) database: PathBuf,
    /// How the folders of models are called: one for each mapper.
    pub(crate) sparse: PathBuf,
    /// Whether each folder of images is a camera of its own.
    pub(crate) rig: bool,
}

impl Job {
    /// The model of the lens. A phone's needs two coefficients. From the single image of a rig's camera only one can be
    /// estimated.
    fn camera_model(&self) -> &'static str {
        if self.rig { "SIMPLE_RADIAL" } else { "OPENCV" }
    }
}

/// How closely images are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Effort {
    /// Larger images are scaled down to this many pixels on the longer side.
    pub(crate) size: u32,
    /// About as many features an image.
    pub(crate) features: u32,
    /// Whether images are doubled in size first: more and finer features in four times the time.
    pub(crate) doubled: bool,
}

/// How cameras are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mapper {
    /// All at once; since version 4.
    Global,
    /// One by one.
    Incremental,
}

/// How the pairs of images moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Motion {
    /// Pairs that moved by more than a tenth of the image.
    pub(crate) moved: usize,
    /// Those of them in which the turn of the camera (or a flat scene) explains it all.
    pub(crate) turned: usize,
}

impl Colmap {
    /// Finds it on this machine. A program that `LIGHT4GS_COLMAP` names is taken whatever its version.
    ///
    /// # Errors
    /// [`DataError::Program`] where there is neither a program nor the package, with how to install them.
    pub(crate) fn find() -> Result<Self, DataError> {
        let program = COLMAP.version();
        let named = std::env::var_os(COLMAP.variable).is_some();
        if let Ok(version) = &program
            && (named || *version >= NEW)
        {
            return Ok(Self::Program(*version));
        }
        match (named, python::version()) {
            (false, Some(version)) => Ok(Self::Package(version)),
            _ => Ok(Self::Program(program?)),
        }
    }

    /// Its name and version, for messages.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Program((u32::MAX, _)) => "COLMAP".to_owned(),
            Self::Program((major, minor)) => format!("COLMAP {major}.{minor}"),
            Self::Package(version) => format!("pycolmap {version}"),
        }
    }

    /// Finds the features of the images. `done` is called with the number of images that are done.
    ///
    /// # Errors
    /// [`DataError::Program`] where COLMAP fails; likewise below.
    pub(crate) fn features(&self, job: &Job, effort: Effort, done: &mut dyn FnMut(usize)) -> Result<(), DataError> {
        match self {
            Self::Program(_) => program::features(job, effort, done),
            Self::Package(_) => python::features(job, effort, done),
        }
    }

    /// Matches the features of the pairs in a file, which has two names a line. The program does not say how they moved.
    pub(crate) fn matches(&self, job: &Job, pairs: &Path) -> Result<Motion, DataError> {
        match self {
            Self::Program(_) => program::matches(job, pairs).map(|()| Motion::default()),
            Self::Package(_) => python::matches(job, pairs),
        }
    }

    /// Whether it has a mapper. A program without a version may be old.
    pub(crate) fn has(&self, mapper: Mapper) -> bool {
        match self {
            Self::Program(version) => mapper == Mapper::Incremental || (*version >= NEW && version.0 != u32::MAX),
            Self::Package(_) => true,
        }
    }

    /// Finds the poses, and writes models into `sparse`, which may stay empty. `done` is called with the number of images
    /// that have a pose.
    pub(crate) fn poses(
        &self,
        job: &Job,
        sparse: &Path,
        mapper: Mapper,
        done: &mut dyn FnMut(usize),
    ) -> Result<(), DataError> {
        match self {
            Self::Program(_) => program::poses(job, sparse, mapper, done),
            Self::Package(_) => python::poses(job, sparse, mapper, done),
        }
    }
}

/// What to do where a stage fails.
const AGAIN: &str = "remove the folder `work` in the output and try again";
/// What to do where no poses are found.
pub(crate) const FILM_AGAIN: &str = "film again: move sideways, slowly, past something with texture; a camera that only turns \
                                     sees no depth (docs/data.md)";

/// The two numbers of `... [3/20]`, as COLMAP counts images.
fn counted(line: &str) -> Option<(usize, usize)> {
    let inside = line.rsplit_once('[')?.1.split_once(']')?.0;
    let (done, total) = inside.split_once('/')?;
    Some((done.trim().parse().ok()?, total.trim().split(',').next()?.parse().ok()?))
}

/// The number of images with a pose, as the mapper counts them: `Registering image #5 (6)`, or since version 3.12
/// `Registering image #5 (num_reg_frames=6)`.
fn registered(line: &str) -> Option<usize> {
    if !line.contains("Registering image #") {
        return None;
    }
    let inside = line.rsplit_once('(')?.1.split_once(')')?.0;
    inside.rsplit('=').next()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_colmap_counts() {
        assert_eq!(counted("Processed file [3/20]"), Some((3, 20)));
        assert_eq!(counted("Matching image [7/20] in 0.1s"), Some((7, 20)));
        assert_eq!(counted("I2024 x.cc:254] Processed file [1/2]"), Some((1, 2)));
        assert_eq!(counted("Name: a.png"), None);
        assert_eq!(registered("Registering image #5 (6)"), Some(6));
        assert_eq!(registered("I1 x.cc:1] Registering image #5 (num_reg_frames=6)"), Some(6));
        assert_eq!(registered("=> Image sees 5 (6)"), None);
    }
}
