//! Errors of a run.

use std::path::PathBuf;

use light4gs_codec::CodecError;
use light4gs_data::DataError;
use light4gs_model::{GpuError, ModelError};

use crate::config::ConfigError;
use crate::divergence::Divergence;

/// An error of training, evaluation or the command line.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A dataset, an image or a file.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A `.l4gs` file.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// A decoded file from whose parts no model can be made.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A GPU kernel, device or buffer.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The user asked for something that is not possible; the text says what to do instead.
    #[error("{0}")]
    Input(String),
    /// A folder holds a run already.
    #[error("{} holds a run already; give --overwrite to replace it, or `light4gs resume` to continue it", .0.display())]
    RunExists(PathBuf),
    /// Another process writes into the folder of a run.
    #[error("{} is in use by {holder}: wait until that is over, or name another folder", root.display())]
    RunInUse {
        /// The folder.
        root: PathBuf,
        /// The process that writes there, as far as it is known.
        holder: String,
    },
    /// A checkpoint from which a run cannot continue.
    #[error(
        "checkpoint {}: {problem}. Remove the file, and `light4gs resume` goes on from the checkpoint before it",
        path.display()
    )]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What was found and expected, with the tensor.
        problem: String,
    },
    /// The user asked a run or a study to stop; it can be continued.
    #[error("{0}")]
    Stopped(String),
    /// Numbers of the training are no longer finite.
    #[error(transparent)]
    Diverged(Box<Divergence>),
}

impl TrainError {
    /// Whether it is a bug of the program (exit code 1), and not wrong input (exit code 2).
    pub fn is_internal(&self) -> bool {
        match self {
            Self::Codec(error) => error.is_internal(),
            Self::Gpu(_) => true,
            _ => false,
        }
    }

    /// The exit code of a program that ends with this error: 2 for wrong input, 1 for a bug, 75 (`EX_TEMPFAIL`: try
    /// again) for a run that was asked to stop.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Stopped(_) => 75,
            error if error.is_internal() => 1,
            _ => 2,
        }
    }
}
