//! Launches as data: inputs and outputs of kernels, so that other implementations of WebGPU can run the same and compare.

use std::cell::RefCell;

use super::kernel::Kernel;

/// One buffer of a launch.
#[derive(Clone, Debug)]
pub struct RecordedBuffer {
    /// Its bytes before the launch; arbitrary for a buffer that the kernel only writes.
    pub before: Vec<u8>,
    /// Its bytes after the launch; `None` where the kernel only reads.
    pub after: Option<Vec<u8>>,
}

/// One launch of a kernel.
#[derive(Clone, Debug)]
pub struct RecordedLaunch {
    /// The kernel.
    pub kernel: Kernel,
    /// Workgroups along x and y; one along z.
    pub groups: [u32; 2],
    /// The buffers in the order of their bindings, all of group 0.
    pub buffers: Vec<RecordedBuffer>,
    /// Words of the uniform, which is bound after the buffers; none if there is no uniform.
    pub uniform: Vec<u32>,
}

thread_local! {
    static RECORDING: RefCell<Option<Vec<RecordedLaunch>>> = const { RefCell::new(None) };
}

/// Runs operations, and returns with their result every launch of a WGSL kernel of ours on this thread, in order. Burn's own
/// kernels are not recorded.
///
/// Every buffer is read back before and after each launch, so this is slow. It is not made to be nested.
pub fn record<R>(run: impl FnOnce() -> R) -> (R, Vec<RecordedLaunch>) {
    RECORDING.replace(Some(Vec::new()));
    let result = run();
    (result, RECORDING.take().unwrap_or_default())
}

/// Whether launches are recorded.
pub(super) fn is_on() -> bool {
    RECORDING.with_borrow(Option::is_some)
}

pub(super) fn add(launch: RecordedLaunch) {
    RECORDING.with_borrow_mut(|launches| {
        if let Some(launches) = launches {
            launches.push(launch);
        }
    });
}
