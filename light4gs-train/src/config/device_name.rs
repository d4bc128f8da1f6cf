//! Names of back ends: `auto`, `ndarray`, `flex`, `wgpu`, `wgpu:0`, `wgpu:discrete`.

use std::fmt;
use std::str::FromStr;

use light4gs_keys::{KeyValue, nearest};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The back ends by name; `wgpu` may be followed by an adapter, as in `wgpu:0` or `wgpu:cpu`.
pub const DEVICES: &[&str] = &["auto", "ndarray", "flex", "wgpu"];

/// A back end, and for `wgpu` its adapter. That a name can be parsed does not mean that this build contains the back
/// end, nor that this machine has the adapter: [`crate::device::open`] tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum DeviceName {
    /// `wgpu` where there is a graphics card, otherwise the processor: [`crate::device::chosen`] decides.
    #[default]
    Auto,
    /// Burn's `ndarray` back end, on the processor.
    NdArray,
    /// Burn's `flex` back end, on the processor: the faster one.
    Flex,
    /// Burn's `wgpu` back end, on a graphics adapter.
    Wgpu(Adapter),
}

/// Which graphics adapter computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Adapter {
    /// The strongest one: `wgpu`.
    #[default]
    Strongest,
    /// A card with memory of its own: `wgpu:discrete`.
    Discrete,
    /// One that shares the processor's memory: `wgpu:integrated`.
    Integrated,
    /// A driver that computes on the processor: `wgpu:cpu`.
    Software,
    /// By its number in the order in which the graphics driver lists them: `wgpu:0`.
    Number(usize),
}

impl DeviceName {
    /// The name without the adapter, one of [`DEVICES`].
    pub fn back_end(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::NdArray => "ndarray",
            Self::Flex => "flex",
            Self::Wgpu(_) => "wgpu",
        }
    }
}

impl fmt::Display for DeviceName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.back_end())?;
        match self {
            Self::Auto | Self::NdArray | Self::Flex | Self::Wgpu(Adapter::Strongest) => Ok(()),
            Self::Wgpu(Adapter::Discrete) => formatter.write_str(":discrete"),
            Self::Wgpu(Adapter::Integrated) => formatter.write_str(":integrated"),
            Self::Wgpu(Adapter::Software) => formatter.write_str(":cpu"),
            Self::Wgpu(Adapter::Number(number)) => write!(formatter, ":{number}"),
        }
    }
}

/// A name that no back end has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown device `{name}`; the nearest is `{nearest}`. It must be one of {}, and wgpu takes an adapter: wgpu:0, \
     wgpu:discrete, wgpu:integrated, wgpu:cpu",
    DEVICES.join(", ")
)]
pub struct UnknownDevice {
    /// As given.
    pub name: String,
    /// The known name most like it.
    pub nearest: &'static str,
}

impl FromStr for DeviceName {
    type Err = UnknownDevice;

    fn from_str(name: &str) -> Result<Self, UnknownDevice> {
        let unknown = || {
            let known = ["auto", "ndarray", "flex", "wgpu", "wgpu:0", "wgpu:discrete", "wgpu:integrated", "wgpu:cpu"];
            let nearest = nearest(known, name);
            UnknownDevice { name: name.to_owned(), nearest: nearest.expect("some names are known") }
        };
        match name {
            "auto" => Ok(Self::Auto),
            "ndarray" => Ok(Self::NdArray),
            "flex" => Ok(Self::Flex),
            "wgpu" => Ok(Self::Wgpu(Adapter::Strongest)),
            "wgpu:discrete" => Ok(Self::Wgpu(Adapter::Discrete)),
            "wgpu:integrated" => Ok(Self::Wgpu(Adapter::Integrated)),
            "wgpu:cpu" => Ok(Self::Wgpu(Adapter::Software)),
            _ => {
                let number = name.strip_prefix("wgpu:").and_then(|number| number.parse().ok());
                number.map(|number| Self::Wgpu(Adapter::Number(number))).ok_or_else(unknown)
            }
        }
    }
}

impl KeyValue for DeviceName {}

impl Serialize for DeviceName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for DeviceName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_written() {
        for name in
            ["auto", "ndarray", "flex", "wgpu", "wgpu:0", "wgpu:12", "wgpu:discrete", "wgpu:integrated", "wgpu:cpu"]
        {
            assert_eq!(name.parse::<DeviceName>().map(|device| device.to_string()).as_deref(), Ok(name));
        }
        for name in ["", "cuda", "wgpu:", "wgpu:-1", "wgpu:fast", "flex:0", "Wgpu"] {
            assert!(name.parse::<DeviceName>().is_err(), "{name}");
        }
        let error = "flxe".parse::<DeviceName>().unwrap_err();
        assert_eq!(error.nearest, "flex");
        assert!(error.to_string().contains("wgpu:cpu"), "{error}");
    }
}
