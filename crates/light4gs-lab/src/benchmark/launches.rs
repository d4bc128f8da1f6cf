//! Kernel launches, on devices that have any.

use std::collections::BTreeMap;

use light4gs_train::config::DeviceName;

/// Counts the launches of the process, if the device launches kernels.
#[derive(Debug)]
pub(super) struct Launches {
    #[cfg(feature = "wgpu")]
    counter: Option<light4gs_model::gpu::LaunchCounter>,
}

impl Launches {
    pub(super) fn on(device: DeviceName) -> Self {
        #[cfg(feature = "wgpu")]
        let launches =
            Self { counter: matches!(device, DeviceName::Wgpu(_)).then(light4gs_model::gpu::LaunchCounter::begin) };
        #[cfg(not(feature = "wgpu"))]
        let launches = {
            let _ = device;
            Self {}
        };
        launches
    }

    /// Those since the beginning, or since the last time that they were taken, by the kernel's name.
    pub(super) fn take(&self) -> BTreeMap<String, u64> {
        #[cfg(feature = "wgpu")]
        let launches = self.counter.as_ref().map(|counter| counter.take()).unwrap_or_default();
        #[cfg(not(feature = "wgpu"))]
        let launches = BTreeMap::new();
        launches
    }
}
