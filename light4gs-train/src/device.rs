//! Opens back ends by name.

// Burn 0.22 deprecates its `ndarray` back end in favour of `flex`; we serve both.
#![allow(deprecated)]

use burn::tensor::Device;

use crate::config::{Adapter, DEVICES, DeviceName, UnknownDevice};
use crate::error::TrainError;

/// The back ends that this build contains, by name: those of [`DEVICES`] whose Cargo feature is on.
pub fn built_in() -> Vec<&'static str> {
    let features = [
        ("auto", true),
        ("ndarray", cfg!(feature = "ndarray")),
        ("flex", cfg!(feature = "flex")),
        ("wgpu", cfg!(feature = "wgpu")),
    ];
    let is_built_in = |name: &&str| features.contains(&(*name, true));
    DEVICES.iter().copied().filter(is_built_in).collect()
}

/// A device for work that gives the same result on every back end: the processor, if this build computes there.
///
/// # Errors
/// [`TrainError::Input`] if this build has no back end.
pub fn any() -> Result<Device, TrainError> {
    open(processor())
}

/// The back end that a name means on this machine: `auto` is a graphics card, a discrete one first, and the processor where there is
/// none. A driver in software is no card.
pub fn chosen(name: DeviceName) -> DeviceName {
    if name != DeviceName::Auto {
        return name;
    }
    #[cfg(feature = "wgpu")]
    for card in [Adapter::Discrete, Adapter::Integrated].map(DeviceName::Wgpu) {
        if open(card).is_ok() {
            return card;
        }
    }
    processor()
}

/// The back end of this build that is fastest on a processor; without one, that for graphics cards.
fn processor() -> DeviceName {
    match (cfg!(feature = "flex"), cfg!(feature = "ndarray")) {
        (true, _) => DeviceName::Flex,
        (false, true) => DeviceName::NdArray,
        (false, false) => DeviceName::Wgpu(Adapter::Strongest),
    }
}

/// The device with a name, without autodiff: `auto`, `ndarray`, `flex`, `wgpu` (the strongest adapter), `wgpu:0` (by number),
/// `wgpu:discrete`, `wgpu:integrated`, `wgpu:cpu` (a software driver).
///
/// # Errors
/// [`TrainError::Input`] for any other name, and as [`open`].
pub fn device_by_name(name: &str) -> Result<Device, TrainError> {
    open(name.parse().map_err(|unknown: UnknownDevice| TrainError::Input(unknown.to_string()))?)
}

/// The device with a name, without autodiff.
///
/// # Errors
/// [`TrainError::Input`] where this build does not contain the back end, or this machine has no such adapter.
pub fn open(name: DeviceName) -> Result<Device, TrainError> {
    match name {
        DeviceName::Auto => open(chosen(name)),
        #[cfg(feature = "ndarray")]
        DeviceName::NdArray => Ok(Device::ndarray()),
        #[cfg(feature = "flex")]
        DeviceName::Flex => Ok(Device::flex()),
        #[cfg(feature = "wgpu")]
        DeviceName::Wgpu(adapter) => wgpu::open(name, adapter),
        #[allow(unreachable_patterns)]
        _ => {
            let back_end = name.back_end();
            // In the archives for Linux there are two programs: a static one cannot load a graphics driver.
            let archive = match back_end {
                "wgpu" => {
                    ", or keep `light4gs-gpu` of the archive for Linux beside `light4gs` (it needs glibc 2.17 or newer)"
                }
                _ => "",
            };
            Err(TrainError::Input(format!(
                "this build has no back end `{back_end}`; it has {}. Name another device, or build with `--features \
                 {back_end}`{archive}",
                built_in().join(", ")
            )))
        }
    }
}

#[cfg(feature = "wgpu")]
mod wgpu {
    //! Graphics adapters.

    use std::collections::HashMap;
    use std::sync::{LazyLock, Mutex};

    use burn::tensor::wgpu::WgpuInitError;
    use burn::tensor::{Device, DeviceKind, DeviceType};

    use crate::config::{Adapter, DeviceName};
    use crate::error::TrainError;

    /// Each adapter is opened once.
    static OPENED: LazyLock<Mutex<HashMap<DeviceName, Device>>> = LazyLock::new(Mutex::default);

    pub(super) fn open(name: DeviceName, adapter: Adapter) -> Result<Device, TrainError> {
        let mut opened = OPENED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some(device) = opened.get(&name) {
            return Ok(device.clone());
        }
        let missing = |problem: String| {
            TrainError::Input(format!(
                "there is no adapter for `{name}`: {problem}. Install a Vulkan driver (in software, on Debian or Ubuntu: \
                 apt-get install mesa-vulkan-drivers), or compute with `--device flex`"
            ))
        };
        let of_kind = |kind: DeviceKind| of_kind(kind).map_err(|error| missing(error.to_string()));
        let device = match adapter {
            Adapter::Strongest => of_kind(DeviceKind::DefaultDevice)?,
            Adapter::Discrete => of_kind(DeviceKind::DiscreteGpu(0))?,
            Adapter::Integrated => of_kind(DeviceKind::IntegratedGpu(0))?,
            Adapter::Software => of_kind(DeviceKind::Cpu)?,
            Adapter::Number(number) => {
                let devices: Vec<Device> = Device::enumerate(DeviceType::Wgpu).into_iter().collect();
                let found = devices.len();
                let counted = || missing(format!("adapters are counted from 0, and {found} were found"));
                devices.into_iter().nth(number).ok_or_else(counted)?
            }
        };
        opened.insert(name, device.clone());
        Ok(device)
    }

    pub(super) fn of_kind(kind: DeviceKind) -> Result<Device, WgpuInitError> {
        match Device::wgpu_options().device_kind(kind.clone()).init() {
            // The program has used this adapter before, without this module.
            Err(WgpuInitError::Registration { .. }) => Ok(Device::wgpu(kind)),
            opened => opened,
        }
    }
}

/// The graphics adapters of this machine, those of software drivers included, in the order of `wgpu:0`, `wgpu:1` and so on.
pub fn adapters() -> Vec<String> {
    #[cfg(feature = "wgpu")]
    {
        use burn::tensor::DeviceType;
        let name = |device: Device| device.identity().map_or_else(|| "unknown".to_owned(), |identity| identity.name);
        Device::enumerate(DeviceType::Wgpu).into_iter().map(name).collect()
    }
    #[cfg(not(feature = "wgpu"))]
    Vec::new()
}

/// Whether a device computes with the processor's own threads, as the caller does.
pub fn computes_on_processor(device: &Device) -> bool {
    let processors: &[fn() -> Device] = &[
        #[cfg(feature = "ndarray")]
        Device::ndarray,
        #[cfg(feature = "flex")]
        Device::flex,
    ];
    let device = device.clone().inner();
    processors.iter().any(|processor| device == processor())
}

/// The name that a wgpu device's adapter reports; `None` for the CPU back ends.
pub fn adapter_name(name: DeviceName, device: &Device) -> Option<String> {
    match chosen(name) {
        #[cfg(feature = "wgpu")]
        DeviceName::Wgpu(_) => device.clone().inner().identity().map(|identity| identity.name),
        _ => {
            let _ = device;
            None
        }
    }
}

/// The text for a device in reports: its name, and for wgpu the adapter's, as in `wgpu (llvmpipe)`.
pub fn describe(name: DeviceName, device: &Device) -> String {
    let name = chosen(name);
    match adapter_name(name, device) {
        Some(adapter) => format!("{name} ({adapter})"),
        None => name.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_names_are_wrong_input() {
        for name in ["", "cuda", "wgpu:fast"] {
            assert!(matches!(device_by_name(name), Err(TrainError::Input(_))), "{name}");
        }
    }

    #[test]
    fn every_built_in_name_opens_or_says_why() {
        for name in DEVICES {
            match device_by_name(name) {
                Ok(_) => assert!(built_in().contains(name), "{name}"),
                Err(error) => assert!(error.to_string().contains(name), "{error}"),
            }
        }
    }

    #[test]
    fn auto_is_a_card_or_the_processor() {
        let name = chosen(DeviceName::Auto);
        assert!(name != DeviceName::Auto && open(name).is_ok(), "{name}");
        assert_eq!(chosen(DeviceName::NdArray), DeviceName::NdArray);
        assert!(open(DeviceName::Auto).is_ok());
    }

    #[cfg(feature = "wgpu")]
    #[test]
    fn a_missing_adapter_is_an_error_with_a_remedy() {
        let text = device_by_name("wgpu:99").unwrap_err().to_string();
        assert!(text.contains("wgpu:99") && text.contains("mesa-vulkan-drivers"), "{text}");
    }

    #[cfg(feature = "wgpu")]
    #[test]
    fn an_adapter_that_is_in_use_opens() {
        for _ in 0..2 {
            let device = wgpu::of_kind(burn::tensor::DeviceKind::Cpu).expect("a Vulkan driver in software");
            let two = burn::tensor::Tensor::<1>::ones([2], &device).sum().into_scalar::<f32>();
            assert_eq!(two, 2.0);
        }
    }

    #[cfg(feature = "wgpu")]
    #[test]
    fn the_software_adapter_has_a_name() {
        let name = DeviceName::Wgpu(Adapter::Strongest);
        let device = open(name).expect("a Vulkan driver, if only in software");
        let described = describe(name, &device);
        assert!(described.starts_with("wgpu (") && described.len() > "wgpu ()".len(), "{described}");
    }
}
