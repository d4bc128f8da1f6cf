//! The kind of output that a name asks for, and sequences of PLY files.

use std::path::Path;

use clap::ValueEnum;
use light4gs_data::{GaussianPly, NumberedFiles, write_ply_zip};
use light4gs_train::error::TrainError;

use super::super::output::say;

/// What a folder holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum FolderOf {
    Ply,
    Glb,
}

/// The kind of output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    PlySequence,
    PlyZip,
    Ply,
    GlbSegments,
    Glb,
    FourDgs,
}

impl Target {
    /// The kind of output for a path: a folder if it exists as one, ends with a slash or has no suffix.
    pub(super) fn of(path: &Path, folder: FolderOf) -> Result<Self, TrainError> {
        let asks_for_folder = path.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
        let Some(suffix) = path.extension().filter(|_| !asks_for_folder && !path.is_dir()) else {
            return Ok(match folder {
                FolderOf::Ply => Self::PlySequence,
                FolderOf::Glb => Self::GlbSegments,
            });
        };
        let shown = path.display();
        if folder != FolderOf::Ply {
            return Err(TrainError::Input(format!(
                "--to glb is for a folder, with a file for each segment, and --out {shown} is a file; for a folder put a slash at the \
                 end of the name"
            )));
        }
        match suffix.to_string_lossy().to_ascii_lowercase().as_str() {
            "ply" => Ok(Self::Ply),
            "zip" => Ok(Self::PlyZip),
            "glb" => Ok(Self::Glb),
            "4dgs" => Ok(Self::FourDgs),
            other => Err(TrainError::Input(format!(
                "--out {shown}: no file of the kind `.{other}` is written, only .ply, .zip, .glb and .4dgs; for a folder of PLY files \
                 put a slash at the end of the name"
            ))),
        }
    }

    pub(super) fn is_folder(self) -> bool {
        matches!(self, Self::PlySequence | Self::GlbSegments)
    }
}

/// Writes a PLY file for each time into a folder.
pub(super) fn write_ply_folder(
    folder: &Path,
    times: impl ExactSizeIterator<Item = Result<GaussianPly, TrainError>>,
) -> Result<(), TrainError> {
    let count = times.len();
    let names = NumberedFiles::new(count, "ply");
    names.open_folder(folder)?;
    for (k, gaussians) in times.enumerate() {
        gaussians?.write(&folder.join(names.name(k)))?;
    }
    say(format_args!("wrote {count} PLY files to {}", folder.display()))
}

/// Writes a PLY file for each time into an archive.
pub(super) fn write_ply_archive(
    path: &Path,
    times: impl ExactSizeIterator<Item = Result<GaussianPly, TrainError>>,
) -> Result<(), TrainError> {
    let count = times.len();
    write_ply_zip(path, times)?;
    say(format_args!("wrote {} ({count} PLY files)", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_what_is_written() {
        let of = |path: &str, folder| Target::of(Path::new(path), folder).map_err(|error| error.to_string());
        for (path, expected) in [
            ("frames", Target::PlySequence),
            ("frames.v2/", Target::PlySequence),
            ("a.ply", Target::Ply),
            ("a.ZIP", Target::PlyZip),
            ("a.glb", Target::Glb),
            ("a.4dgs", Target::FourDgs),
        ] {
            assert_eq!(of(path, FolderOf::Ply), Ok(expected), "{path}");
        }
        assert_eq!(of("segments/", FolderOf::Glb), Ok(Target::GlbSegments));
        assert!(of("a.glb", FolderOf::Glb).unwrap_err().contains("--to glb is for a folder"));
        assert!(of("a.png", FolderOf::Ply).unwrap_err().contains(".png"));
    }
}
