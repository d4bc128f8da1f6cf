//! The one error type of this crate: it says what is wrong, where, and what to do.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Why a dataset, an image or a point cloud could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// The operating system refused a read or a write.
    #[error("cannot {action} {}: {source}{}", path.display(), remedy_of(source))]
    Io {
        /// What was attempted: `read`, `write`, `create`...
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        #[source]
        source: std::io::Error,
    },
    /// A text file does not have its format, so no field can be named.
    #[error("{}: not valid JSON: {source}; export the file again", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// The parser's reason, with line and column.
        #[source]
        source: serde_json::Error,
    },
    /// One named field of a file is missing or has an unusable value.
    #[error("{}: {field}: {problem}; {remedy}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field, such as `frames[3].time`.
        field: String,
        /// What was found and what was expected.
        problem: String,
        /// What the user can do about it.
        remedy: String,
    },
    /// An image is missing, damaged, or of another size than the rest.
    #[error("image {}: {problem}; {remedy}", path.display())]
    Image {
        /// The image's file.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
        /// What the user can do about it.
        remedy: String,
    },
    /// A PLY file is damaged or has another layout than expected.
    #[error("PLY file {}: {problem}; {remedy}", path.display())]
    Ply {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
        /// What the user can do about it.
        remedy: String,
    },
    /// Another program is missing, too old, or did not do what it should.
    #[error("{program}: {problem}; {remedy}")]
    Program {
        /// The program, such as `ffmpeg`.
        program: &'static str,
        /// What happened.
        problem: String,
        /// What the user can do about it.
        remedy: String,
    },
    /// A folder holds none of the known dataset layouts.
    #[error("{}: no known dataset layout: {problem}; {remedy}", path.display())]
    UnknownLayout {
        /// The folder.
        path: PathBuf,
        /// What was looked for.
        problem: String,
        /// What the user can do about it.
        remedy: String,
    },
    /// The output exists already, and nothing is ever overwritten silently.
    #[error("{} exists already and is not empty; remove it or name another folder", path.display())]
    Exists {
        /// The folder or file that is in the way.
        path: PathBuf,
    },
    /// An option of the caller is out of its range.
    #[error("option {option}: {problem}")]
    Options {
        /// The option's name.
        option: &'static str,
        /// What was given and what was expected.
        problem: String,
    },
}

/// The remedy, where it follows from the system's reason.
fn remedy_of(source: &std::io::Error) -> &'static str {
    match source.kind() {
        ErrorKind::NotFound => "; restore the file, or check the path",
        ErrorKind::PermissionDenied => "; change its permissions, or name another place",
        ErrorKind::InvalidData => "; save it as UTF-8",
        ErrorKind::StorageFull => "; make room on the disk",
        _ => "",
    }
}

impl DataError {
    /// A function for `map_err` that adds what was attempted, and with which file.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { action, path, source }
    }

    /// A bad field of a text file.
    pub fn field(path: &Path, field: impl Into<String>, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Field { path: path.to_path_buf(), field: field.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// A bad image.
    pub fn image(path: &Path, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Image { path: path.to_path_buf(), problem: problem.into(), remedy: remedy.into() }
    }

    /// A bad PLY file.
    pub fn ply(path: &Path, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Ply { path: path.to_path_buf(), problem: problem.into(), remedy: remedy.into() }
    }
}
