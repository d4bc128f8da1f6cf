//! Back ends by name.

// Burn 0.22 deprecates its `ndarray` back end in favour of `flex`; we serve both.
#![allow(deprecated)]

use burn::tensor::Device;

use crate::config::DEVICES;
use crate::error::TrainError;

/// The device that a name such as `ndarray` or `flex` stands for, without autodiff.
///
/// # Errors
/// [`TrainError::Input`] for any other name.
pub fn device_by_name(name: &str) -> Result<Device, TrainError> {
    match name {
        "ndarray" => Ok(Device::ndarray()),
        "flex" => Ok(Device::flex()),
        _ => Err(TrainError::Input(format!(
            "unknown device `{name}`; this program was built with {}",
            DEVICES.join(", ")
        ))),
    }
}
