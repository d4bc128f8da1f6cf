//! Errors of GPU operations as ordinary errors.

use std::panic::{self, AssertUnwindSafe};
use std::sync::Arc;

use light4gs_model::GpuError;

use crate::error::TrainError;

/// Runs a command. Errors of GPU operations arrive as panics, since Burn's operations return no results: they become
/// ordinary errors here, and are not reported as panics. The panic hook is the caller's again at the end.
pub(super) fn catch(run: impl FnOnce() -> Result<(), TrainError>) -> Result<(), TrainError> {
    let previous = Arc::new(panic::take_hook());
    let report = previous.clone();
    panic::set_hook(Box::new(move |info| {
        if !info.payload().is::<GpuError>() {
            report(info);
        }
    }));
    // Other panics are caught as well, since a hook cannot be set while a panic unwinds; they go on after that.
    let outcome = panic::catch_unwind(AssertUnwindSafe(|| GpuError::catch(run)));
    panic::set_hook(Box::new(move |info| previous(info)));
    outcome.unwrap_or_else(|panic| panic::resume_unwind(panic))?
}
