//! Errors of GPU operations, turned into ordinary errors.

use std::panic::{self, AssertUnwindSafe};
use std::sync::Arc;

use light4gs_model::GpuError;
use light4gs_train::error::TrainError;

/// Runs a command. Errors of GPU operations are panics, since Burn's operations return no results. They become ordinary
/// errors here, and are not reported as panics. At the end the caller's panic hook is restored.
pub(super) fn catch(run: impl FnOnce() -> Result<(), TrainError>) -> Result<(), TrainError> {
    let previous = Arc::new(panic::take_hook());
    let report = previous.clone();
    panic::set_hook(Box::new(move |info| {
        if !info.payload().is::<GpuError>() {
            report(info);
        }
    }));
    // Other panics are caught as well, since a hook cannot be set during a panic; they are resumed afterwards.
    let outcome = panic::catch_unwind(AssertUnwindSafe(|| GpuError::catch(run)));
    panic::set_hook(Box::new(move |info| previous(info)));
    outcome.unwrap_or_else(|panic| panic::resume_unwind(panic))?
}
