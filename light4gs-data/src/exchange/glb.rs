//! One static set of Gaussians as binary glTF 2.0 with the extension `KHR_gaussian_splatting`.
//!
//! The extension holds activated values: scales and opacities are activated, quaternions have unit length and the order
//! (x, y, z, w). Its spherical harmonics are those of 3DGS, coefficient by coefficient.

use std::io::Write;
use std::path::Path;

use serde_json::{Map, Value, json};

use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::ply::GaussianPly;
use crate::points::SH_C0;

const EXTENSION: &str = "KHR_gaussian_splatting";
/// glTF's numbers for points, for float32 and for a buffer of vertex attributes.
const POINTS: u32 = 0;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;

/// Options of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct GlbOptions {
    /// Highest degree of the spherical harmonics that is written, 0 to 3.
    pub sh_degree: u8,
    /// Whether the scene's z axis points up; glTF's y axis does, so the scene's node is rotated then.
    pub z_is_up: bool,
}

impl Default for GlbOptions {
    fn default() -> Self {
        Self { sh_degree: 3, z_is_up: false }
    }
}

/// Vertex attributes, one after the other in one buffer.
#[derive(Default)]
struct Attributes {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    names: Map<String, Value>,
}

impl Attributes {
    fn add<const N: usize>(&mut self, name: String, rows: impl Iterator<Item = [f32; N]>, bounded: bool) {
        let begin = self.bytes.len();
        let (mut low, mut high, mut count) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N], 0);
        for row in rows {
            for (axis, value) in row.into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(value), high[axis].max(value));
                self.bytes.extend(value.to_le_bytes());
            }
            count += 1;
        }
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor =
            json!({"bufferView": self.views.len(), "componentType": FLOAT, "count": count, "type": kind});
        if bounded {
            accessor["min"] = json!(low.to_vec());
            accessor["max"] = json!(high.to_vec());
        }
        let length = self.bytes.len() - begin;
        self.views.push(json!({"buffer": 0, "byteOffset": begin, "byteLength": length, "target": ARRAY_BUFFER}));
        self.names.insert(name, json!(self.accessors.len()));
        self.accessors.push(accessor);
    }
}

/// Writes [`glb_bytes`]; the file is complete or absent.
///
/// # Errors
/// As [`glb_bytes`]; [`DataError::Io`] when it cannot be written.
pub fn write_glb(path: &Path, gaussians: &GaussianPly, options: &GlbOptions) -> Result<(), DataError> {
    let bytes = glb_bytes(path, gaussians, options)?;
    write_atomically(path, |out| out.write_all(&bytes))
}

/// A binary glTF file. Gaussians whose quaternion has no direction get the identity.
///
/// # Errors
/// [`DataError::Options`] for a degree above 3; [`DataError::Field`] naming `path` for no Gaussians, which glTF cannot hold,
/// for numbers that are not finite and for more than 4 GiB.
pub fn glb_bytes(path: &Path, gaussians: &GaussianPly, options: &GlbOptions) -> Result<Vec<u8>, DataError> {
    if options.sh_degree > 3 {
        let problem = format!("{}, expected 0 to 3", options.sh_degree);
        return Err(DataError::Options { option: "sh_degree", problem });
    }
    let wrong = |field: &str, problem: &str| DataError::field(path, field, problem, "write a PLY instead");
    if gaussians.is_empty() {
        return Err(wrong("accessors", "there are no Gaussians, and glTF has no empty accessors"));
    }
    let attributes = attributes(gaussians, options);
    if attributes.bytes.as_chunks::<4>().0.iter().any(|bytes| !f32::from_le_bytes(*bytes).is_finite()) {
        return Err(wrong("buffer", "a value is NaN or infinite, which glTF forbids"));
    }
    let json = scene_json(&attributes, options).to_string();
    let padded = json.len().next_multiple_of(4);
    let total = 12 + 8 + padded + 8 + attributes.bytes.len();
    let Ok(total) = u32::try_from(total) else { return Err(wrong("length", "it would be over 4 GiB")) };
    let mut bytes = Vec::with_capacity(total as usize);
    bytes.extend(b"glTF");
    bytes.extend(2u32.to_le_bytes());
    bytes.extend(total.to_le_bytes());
    bytes.extend((padded as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json.as_bytes());
    bytes.resize(20 + padded, b' ');
    bytes.extend((attributes.bytes.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(&attributes.bytes);
    Ok(bytes)
}

fn attributes(gaussians: &GaussianPly, options: &GlbOptions) -> Attributes {
    let mut attributes = Attributes::default();
    let opacities = gaussians.opacity_logits.iter().map(|logit| 1.0 / (1.0 + (-logit).exp()));
    attributes.add("POSITION".into(), gaussians.means.iter().copied(), true);
    // For viewers that know only points: linear colors, whereas the harmonics give sRGB.
    let color = |(dc, alpha): (&[f32; 3], f32)| {
        let [r, g, b] = dc.map(|value| srgb_to_linear((value * SH_C0 + 0.5).clamp(0.0, 1.0)));
        [r, g, b, alpha]
    };
    attributes.add("COLOR_0".into(), gaussians.sh_dc.iter().zip(opacities.clone()).map(color), false);
    attributes.add(format!("{EXTENSION}:ROTATION"), gaussians.quats.iter().map(|quat| unit_xyzw(*quat)), false);
    let scales = gaussians.log_scales.iter().map(|scale| scale.map(f32::exp));
    attributes.add(format!("{EXTENSION}:SCALE"), scales, false);
    attributes.add(format!("{EXTENSION}:OPACITY"), opacities.map(|opacity| [opacity]), false);
    attributes.add(format!("{EXTENSION}:SH_DEGREE_0_COEF_0"), gaussians.sh_dc.iter().copied(), false);
    for degree in 1..=usize::from(options.sh_degree) {
        for coefficient in 0..2 * degree + 1 {
            let at = degree * degree - 1 + coefficient;
            let rows = gaussians.sh_rest.iter().map(|rest| rest[at]);
            attributes.add(format!("{EXTENSION}:SH_DEGREE_{degree}_COEF_{coefficient}"), rows, false);
        }
    }
    attributes
}

fn scene_json(attributes: &Attributes, options: &GlbOptions) -> Value {
    let mut node = json!({"mesh": 0});
    if options.z_is_up {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        node["rotation"] = json!([-half, 0.0, 0.0, half]);
    }
    json!({
        "asset": {"version": "2.0", "generator": concat!("Light4GS ", env!("CARGO_PKG_VERSION"))},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"primitives": [{
            "mode": POINTS,
            "attributes": attributes.names,
            "extensions": {EXTENSION: {
                "kernel": "ellipse",
                "colorSpace": "srgb_rec709_display",
                "projection": "perspective",
                "sortingMethod": "cameraDistance",
            }},
        }]}],
        "buffers": [{"byteLength": attributes.bytes.len()}],
        "bufferViews": attributes.views,
        "accessors": attributes.accessors,
    })
}

/// `(w, x, y, z)` of any length to `(x, y, z, w)` of length 1.
fn unit_xyzw([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    let length = (w * w + x * x + y * y + z * z).sqrt();
    if length > 0.0 && length.is_finite() { [x, y, z, w].map(|part| part / length) } else { [0.0, 0.0, 0.0, 1.0] }
}

/// IEC 61966-2-1.
pub(super) fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}
