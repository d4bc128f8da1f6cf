//! SIGUSR1: the program writes a checkpoint and ends with exit code 75.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

/// Set when the process has been asked to stop. The first call installs the handler.
pub(super) fn stop_flag() -> Arc<AtomicBool> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    FLAG.get_or_init(|| {
        let flag = Arc::new(AtomicBool::new(false));
        #[cfg(unix)]
        if let Err(error) = signal_hook::flag::register(signal_hook::consts::SIGUSR1, Arc::clone(&flag)) {
            super::output::tell(format_args!("warning: this run cannot be stopped by SIGUSR1: {error}"));
        }
        flag
    })
    .clone()
}
