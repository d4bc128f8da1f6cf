//! What the host reads from devices: on a GPU it waits for each time, until everything launched before has run.

use std::sync::atomic::{AtomicU64, Ordering};

static COUNT: AtomicU64 = AtomicU64::new(0);
static BYTES: AtomicU64 = AtomicU64::new(0);

/// Read-backs of the process, of operations and training steps, on any device.
///
/// ```
/// use burn::tensor::{Device, Tensor, Transaction};
/// use light4gs_model::{GpuError, ReadBacks};
///
/// let before = ReadBacks::so_far();
/// let two = Tensor::<1>::from_floats([2.0], &Device::flex());
/// GpuError::read("an example", Transaction::default().register(two)).unwrap();
/// assert_eq!(before.until_now(), ReadBacks { count: 1, bytes: 4 });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadBacks {
    /// Number of times. Tensors that are read together count once.
    pub count: u64,
    /// Bytes read.
    pub bytes: u64,
}

impl ReadBacks {
    /// Those since the process began.
    pub fn so_far() -> Self {
        Self { count: COUNT.load(Ordering::Relaxed), bytes: BYTES.load(Ordering::Relaxed) }
    }

    /// Those since `self` was taken.
    pub fn until_now(self) -> Self {
        let now = Self::so_far();
        Self { count: now.count - self.count, bytes: now.bytes - self.bytes }
    }

    pub(crate) fn count(bytes: usize) {
        COUNT.fetch_add(1, Ordering::Relaxed);
        BYTES.fetch_add(bytes as u64, Ordering::Relaxed);
    }
}
