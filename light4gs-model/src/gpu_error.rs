//! Errors of a GPU.

use std::any::Any;

use burn::tensor::{TensorData, Transaction};

use crate::read_backs::ReadBacks;

/// An error of a GPU operation.
///
/// Burn's operations return tensors, not results, so these errors are panics with a `GpuError` as their payload.
/// [`GpuError::catch`] turns them into results.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// A kernel did not compile or could not be launched.
    #[error(
        "GPU kernel `{kernel}` failed on {adapter}: {reason}. Update the graphics driver, choose another adapter \
         (`wgpu:0`, `wgpu:integrated`, `wgpu:cpu`), or compute on the CPU with `--device flex`"
    )]
    Kernel {
        /// File in `shaders/`, without its suffix.
        kernel: &'static str,
        /// Name of the runtime.
        adapter: String,
        /// The message of the driver or the shader compiler.
        reason: String,
    },
    /// Results cannot be read: the device is lost, out of memory, or an earlier operation failed.
    #[error(
        "the GPU could not finish `{operation}`: {reason}. If memory is short, render smaller images or fewer \
         Gaussians; if the device was lost, start again from the last checkpoint"
    )]
    Device {
        /// The operation that was waited for.
        operation: &'static str,
        /// The message of the driver.
        reason: String,
    },
    /// A buffer is larger than the adapter can bind.
    #[error(
        "the buffer `{buffer}` would take {bytes} bytes, and this adapter binds at most {limit}: render smaller \
         images or fewer Gaussians, or choose another adapter"
    )]
    TooLarge {
        /// Its contents.
        buffer: &'static str,
        /// Bytes that were asked for.
        bytes: u64,
        /// The adapter's limit.
        limit: u64,
    },
    /// The image has more cells than a launch can count.
    #[error("an image of {width}×{height} is too large for this adapter; at most {limit} cells of 16×16 pixels")]
    Image {
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

impl GpuError {
    /// Panics with the error as the payload. A program that prints the error itself should install a silent panic hook,
    /// see [`GpuError::catch`].
    pub(crate) fn raise(self) -> ! {
        std::panic::panic_any(self)
    }

    /// Reads tensors back, waiting for everything that they depend on. Where an earlier operation has failed, so does this.
    ///
    /// ```
    /// use burn::tensor::{Device, Tensor, Transaction};
    /// use light4gs_model::GpuError;
    ///
    /// let two = Tensor::<1>::from_floats([2.0], &Device::flex());
    /// let read = GpuError::read("an example", Transaction::default().register(two)).unwrap();
    /// assert_eq!(read[0].iter::<f32>().next(), Some(2.0));
    /// ```
    ///
    /// # Errors
    /// [`GpuError::Device`] with the message of the driver.
    pub fn read(operation: &'static str, tensors: Transaction) -> Result<Vec<TensorData>, Self> {
        let failed = |reason: String| Self::Device { operation, reason: first_lines(&reason) };
        let read = tensors.try_execute().map_err(|error| failed(error.to_string()))?;
        ReadBacks::count(read.iter().map(|data| data.bytes().len()).sum());
        Ok(read)
    }

    /// The error that is the payload of a panic; any other payload is returned unchanged.
    ///
    /// # Errors
    /// The payload, if the panic was of another kind.
    pub fn from_panic(payload: Box<dyn Any + Send>) -> Result<Self, Box<dyn Any + Send>> {
        payload.downcast::<Self>().map(|error| *error)
    }

    /// Runs operations and returns the error with which one of them panicked. Other panics continue.
    ///
    /// The panic hook is called even so. A program that prints these errors itself should install a hook that prints
    /// nothing where `payload().is::<GpuError>()`.
    ///
    /// ```
    /// use light4gs_model::GpuError;
    ///
    /// assert_eq!(GpuError::catch(|| 2 + 2), Ok(4));
    /// ```
    ///
    /// # Errors
    /// The error with which an operation panicked.
    pub fn catch<T>(run: impl FnOnce() -> T) -> Result<T, Self> {
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(run))
            .map_err(|payload| Self::from_panic(payload).unwrap_or_else(|other| std::panic::resume_unwind(other)))
    }
}

/// The part of a driver's message that is useful to a reader, without the backtrace.
pub(crate) fn first_lines(message: &str) -> String {
    let end = message.find("Backtrace").or_else(|| message.find("BACKTRACE")).unwrap_or(message.len());
    message[..end].split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raised_error_is_caught_and_other_panics_go_on() {
        let error = GpuError::Runtime("cuda".into());
        let raised = error.clone();
        assert_eq!(GpuError::catch(|| raised.raise()), Err(error));
        let other = std::panic::catch_unwind(|| GpuError::catch(|| panic!("another")));
        assert_eq!(other.unwrap_err().downcast_ref::<&str>(), Some(&"another"));
    }
}
