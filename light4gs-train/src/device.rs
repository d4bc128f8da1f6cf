//! Back ends by name.

// Burn 0.22 deprecates its `ndarray` back end in favour of `flex`; we serve both.
#![allow(deprecated)]

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex};

use burn::tensor::{Device, DeviceKind, DeviceType};

use crate::config::DEVICES;
use crate::error::TrainError;

/// What may follow `wgpu:`, besides numbers.
fn adapter_kind(name: &str) -> Option<DeviceKind> {
    match name {
        "discrete" => Some(DeviceKind::DiscreteGpu(0)),
        "integrated" => Some(DeviceKind::IntegratedGpu(0)),
        "cpu" => Some(DeviceKind::Cpu),
        _ => None,
    }
}

/// A device's name, taken apart.
#[derive(Clone, Debug)]
enum Name {
    NdArray,
    Flex,
    Wgpu(Adapter),
}

#[derive(Clone, Debug)]
enum Adapter {
    Kind(DeviceKind),
    /// In the order in which the graphics driver lists them.
    Number(usize),
}

fn parse(name: &str) -> Option<Name> {
    Some(match name {
        "ndarray" => Name::NdArray,
        "flex" => Name::Flex,
        "wgpu" => Name::Wgpu(Adapter::Kind(DeviceKind::DefaultDevice)),
        _ => {
            let adapter = name.strip_prefix("wgpu:")?;
            let kind = adapter_kind(adapter).map(Adapter::Kind);
            Name::Wgpu(kind.or_else(|| adapter.parse().ok().map(Adapter::Number))?)
        }
    })
}

/// Whether a name is one that [`device_by_name`] understands; it may still have no such adapter.
pub fn is_device_name(name: &str) -> bool {
    parse(name).is_some()
}

/// Whether a device's work is done by the processor's own threads, as the caller's is.
pub fn computes_on_processor(name: &str) -> bool {
    matches!(parse(name), Some(Name::NdArray | Name::Flex))
}

/// The device that a name stands for, without autodiff: `ndarray`, `flex`, `wgpu` (the strongest adapter), `wgpu:0` (by
/// number), `wgpu:discrete`, `wgpu:integrated`, `wgpu:cpu` (a software driver).
///
/// # Errors
/// [`TrainError::Input`] for any other name, and where there is no such adapter.
pub fn device_by_name(name: &str) -> Result<Device, TrainError> {
    match parse(name) {
        Some(Name::NdArray) => Ok(Device::ndarray()),
        Some(Name::Flex) => Ok(Device::flex()),
        Some(Name::Wgpu(adapter)) => wgpu(name, adapter),
        None => Err(TrainError::Input(format!(
            "unknown device `{name}`; this program was built with {}, and wgpu takes an adapter: wgpu:0, wgpu:discrete, \
             wgpu:integrated, wgpu:cpu",
            DEVICES.join(", ")
        ))),
    }
}

/// Each adapter is opened once.
static OPENED: LazyLock<Mutex<HashMap<String, Device>>> = LazyLock::new(Mutex::default);

fn wgpu(name: &str, adapter: Adapter) -> Result<Device, TrainError> {
    let mut opened = OPENED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    if let Some(device) = opened.get(name) {
        return Ok(device.clone());
    }
    let missing = |problem: String| {
        TrainError::Input(format!(
            "there is no adapter for `{name}`: {problem}. Install a Vulkan driver (in software, on Debian or Ubuntu: \
             apt-get install mesa-vulkan-drivers), or compute with `--device flex`"
        ))
    };
    let device = match adapter {
        Adapter::Kind(kind) => {
            Device::wgpu_options().device_kind(kind).init().map_err(|error| missing(error.to_string()))?
        }
        Adapter::Number(number) => {
            let devices: Vec<Device> = Device::enumerate(DeviceType::Wgpu).into_iter().collect();
            let found = devices.len();
            let counted = || missing(format!("adapters are counted from 0, and {found} were found"));
            devices.into_iter().nth(number).ok_or_else(counted)?
        }
    };
    opened.insert(name.to_owned(), device.clone());
    Ok(device)
}

/// The name that a wgpu device's adapter has for itself.
pub fn adapter_name(name: &str, device: &Device) -> Option<String> {
    matches!(parse(name), Some(Name::Wgpu(_))).then(|| device.clone().inner().identity()).flatten().map(|i| i.name)
}

/// What reports say of a device: its name, and for wgpu the adapter's own, as in `wgpu (llvmpipe)`.
pub fn describe(name: &str, device: &Device) -> String {
    match adapter_name(name, device) {
        Some(adapter) => format!("{name} ({adapter})"),
        None => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names() {
        for name in ["ndarray", "flex", "wgpu", "wgpu:0", "wgpu:12", "wgpu:discrete", "wgpu:integrated", "wgpu:cpu"] {
            assert!(is_device_name(name), "{name}");
        }
        for name in ["", "cuda", "wgpu:", "wgpu:-1", "wgpu:fast", "flex:0", "Wgpu"] {
            assert!(!is_device_name(name), "{name}");
            assert!(matches!(device_by_name(name), Err(TrainError::Input(_))), "{name}");
        }
    }

    #[test]
    fn a_missing_adapter_is_an_error_with_a_remedy() {
        let text = device_by_name("wgpu:99").unwrap_err().to_string();
        assert!(text.contains("wgpu:99") && text.contains("mesa-vulkan-drivers"), "{text}");
    }

    #[test]
    fn the_software_adapter_has_a_name() {
        let device = device_by_name("wgpu").expect("a Vulkan driver, if only in software");
        let described = describe("wgpu", &device);
        assert!(described.starts_with("wgpu (") && described.len() > "wgpu ()".len(), "{described}");
    }
}
