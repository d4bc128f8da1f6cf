//! What can go wrong on a GPU.

use std::sync::Mutex;

/// An error of a GPU operation.
///
/// Burn's operations return tensors and no results, so these errors travel as panics; [`GpuError::take`] gets one back
/// after [`std::panic::catch_unwind`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// A kernel did not compile or could not be launched.
    #[error(
        "GPU kernel `{kernel}` failed on {adapter}: {reason}. Update the graphics driver, choose another adapter \
         (`wgpu:0`, `wgpu:integrated`, `wgpu:cpu`), or compute on the CPU with `--device flex`"
    )]
    Kernel {
        /// File in `shaders/`, without its ending.
        kernel: &'static str,
        /// Name of the runtime.
        adapter: String,
        /// What the driver or the shader compiler says.
        reason: String,
    },
    /// Results cannot be read: the device is lost, out of memory, or an earlier operation failed.
    #[error(
        "the GPU could not finish `{operation}`: {reason}. If memory is short, render smaller pictures or fewer \
         Gaussians; if the device was lost, start again from the last checkpoint"
    )]
    Device {
        /// What was waited for.
        operation: &'static str,
        /// What the driver says.
        reason: String,
    },
    /// A buffer is larger than the adapter can bind.
    #[error(
        "the buffer `{buffer}` would take {bytes} bytes, and this adapter binds at most {limit}: render smaller \
         pictures or fewer Gaussians, or choose another adapter"
    )]
    TooLarge {
        /// What it holds.
        buffer: &'static str,
        /// Asked for.
        bytes: u64,
        /// The adapter's limit.
        limit: u64,
    },
    /// The picture has more parts than a launch can name.
    #[error("a picture of {width}×{height} is too large for this adapter; at most {limit} cells of 16×16 pixels")]
    Picture {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Cells.
        limit: u32,
    },
    /// Another CubeCL runtime than wgpu, or one whose shaders are not WGSL.
    #[error(
        "the custom kernels are WGSL, and the CubeCL runtime `{0}` does not take it: use `--device wgpu`, and build burn \
         with the feature `wgpu` and without `vulkan`, `metal`, `cuda`"
    )]
    Runtime(String),
}

static LAST: Mutex<Option<GpuError>> = Mutex::new(None);

impl GpuError {
    /// Panics with the error, and keeps it for [`GpuError::take`].
    pub(crate) fn raise(self) -> ! {
        let message = self.to_string();
        *LAST.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(self);
        panic!("{message}");
    }

    /// Whether a GPU operation has panicked with an error that nobody has taken yet.
    pub fn is_raised() -> bool {
        LAST.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).is_some()
    }

    /// The error that a GPU operation last panicked with, once.
    pub fn take() -> Option<Self> {
        LAST.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take()
    }
}
