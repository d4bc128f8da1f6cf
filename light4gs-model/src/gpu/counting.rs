//! Counts launches of kernels: on a GPU each launch costs the host some microseconds, whatever the kernel does.

use std::any::type_name;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use burn_wgpu::SourceKernel;
use cubecl::config::{TypeNameFormatLevel, type_name_format};
use cubecl::logging::{LaunchObservation, LaunchObserver};

use super::kernel::Kernel;

/// Launches by the kernel's name, those of Burn's own kernels too.
pub type LaunchCounts = BTreeMap<String, u64>;

/// Counts all launches of the process from its beginning on, on whatever thread and adapter. Only the one that began last
/// counts.
pub struct LaunchCounter {
    counts: Arc<Counts>,
    _observation: LaunchObservation,
}

/// By the kernel's name, or by the name of its type where it is Burn's.
#[derive(Default)]
struct Counts(Mutex<BTreeMap<&'static str, u64>>);

impl Counts {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<&'static str, u64>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl LaunchObserver for Counts {
    fn launched(&self, kernel: &'static str) {
        // All of our own have one type; `launching` has told their names.
        if kernel != type_name::<SourceKernel<Kernel>>() {
            *self.lock().entry(kernel).or_default() += 1;
        }
    }
}

/// The counts of the counter that began last.
static OWN: Mutex<Weak<Counts>> = Mutex::new(Weak::new());

/// Counts a launch of one of our own kernels.
pub(super) fn launching(kernel: &'static str) {
    if let Some(counts) = OWN.lock().unwrap_or_else(PoisonError::into_inner).upgrade() {
        *counts.lock().entry(kernel).or_default() += 1;
    }
}

impl LaunchCounter {
    /// Begins to count.
    pub fn begin() -> Self {
        let counts = Arc::<Counts>::default();
        *OWN.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(&counts);
        Self { _observation: LaunchObservation::new(counts.clone()), counts }
    }

    /// The launches since the beginning, or since the last time that they were taken.
    pub fn take(&self) -> LaunchCounts {
        let counts = std::mem::take(&mut *self.counts.lock());
        let mut named = LaunchCounts::new();
        for (kernel, count) in counts {
            *named.entry(type_name_format(kernel, TypeNameFormatLevel::Balanced)).or_default() += count;
        }
        named
    }
}

impl fmt::Debug for LaunchCounter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LaunchCounter").finish_non_exhaustive()
    }
}
