//! Gaussians as binary glTF 2.0 with the extension `KHR_gaussian_splatting`: at one time, or with a skin that moves them.
//!
//! The extension holds activated values: scales and opacities are activated, quaternions have unit length and the order
//! (x, y, z, w). Its spherical harmonics are those of 3DGS, coefficient by coefficient.

use std::io::Write;
use std::path::Path;

use serde_json::{Map, Value, json};

use super::accessors::{Accessors, VERTICES};
use super::conventions::{srgb_to_linear, unit_xyzw};
use super::skin::Skin;
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::ply::GaussianPly;
use crate::points::SH_C0;

const EXTENSION: &str = "KHR_gaussian_splatting";
/// glTF's number for points.
const POINTS: u32 = 0;

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

/// Writes [`glb_bytes`]; the file is complete or absent.
///
/// # Errors
/// As [`glb_bytes`]; [`DataError::Io`] when it cannot be written.
pub fn write_glb(
    path: &Path,
    gaussians: &GaussianPly,
    skin: Option<&Skin>,
    options: &GlbOptions,
) -> Result<(), DataError> {
    let bytes = glb_bytes(path, gaussians, skin, options)?;
    write_atomically(path, |out| out.write_all(&bytes))
}

/// A binary glTF file. Gaussians whose quaternion has no direction get the identity. With a skin they move: the Gaussians are
/// those at rest, and the file has an animation.
///
/// # Errors
/// [`DataError::Options`] for a degree above 3, and for a skin of another number of Gaussians; [`DataError::Field`] naming
/// `path` for no Gaussians, which glTF cannot hold, for numbers that are not finite and for more than 4 GiB.
pub fn glb_bytes(
    path: &Path,
    gaussians: &GaussianPly,
    skin: Option<&Skin>,
    options: &GlbOptions,
) -> Result<Vec<u8>, DataError> {
    let option = |option, problem| Err(DataError::Options { option, problem });
    if options.sh_degree > 3 {
        return option("sh_degree", format!("{}, expected 0 to 3", options.sh_degree));
    }
    if let Some(skin) = skin.filter(|skin| skin.gaussians() != gaussians.len()) {
        return option("skin", format!("of {} Gaussians, expected {}", skin.gaussians(), gaussians.len()));
    }
    let wrong = |field: &str, problem: &str| DataError::field(path, field, problem, "write a PLY instead");
    if gaussians.is_empty() {
        return Err(wrong("accessors", "there are no Gaussians, and glTF has no empty accessors"));
    }
    let mut accessors = Accessors::default();
    let mut names = attributes(&mut accessors, gaussians, options);
    if let Some(skin) = skin {
        skin.add_influences(&mut accessors, &mut names);
    }
    let mut json = scene_json(names, options);
    if let Some(skin) = skin {
        skin.add_motion(&mut accessors, &mut json);
    }
    let Accessors { bytes: numbers, views, list, not_finite } = accessors;
    if not_finite {
        return Err(wrong("buffer", "a value is NaN or infinite, which glTF forbids"));
    }
    json["buffers"] = json!([{"byteLength": numbers.len()}]);
    json["bufferViews"] = views.into();
    json["accessors"] = list.into();
    let json = json.to_string();
    let padded = json.len().next_multiple_of(4);
    let total = 12 + 8 + padded + 8 + numbers.len();
    let Ok(total) = u32::try_from(total) else { return Err(wrong("length", "it would be over 4 GiB")) };
    let mut bytes = Vec::with_capacity(total as usize);
    bytes.extend(b"glTF");
    bytes.extend(2u32.to_le_bytes());
    bytes.extend(total.to_le_bytes());
    bytes.extend((padded as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json.as_bytes());
    bytes.resize(20 + padded, b' ');
    bytes.extend((numbers.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(&numbers);
    Ok(bytes)
}

/// Adds the attributes of the Gaussians, and returns the accessors by name.
fn attributes(accessors: &mut Accessors, gaussians: &GaussianPly, options: &GlbOptions) -> Map<String, Value> {
    let mut names = Map::new();
    let mut name = |name: String, accessor: usize| names.insert(name, json!(accessor));
    let opacities = gaussians.opacity_logits.iter().map(|logit| 1.0 / (1.0 + (-logit).exp()));
    name("POSITION".into(), accessors.add_bounded(gaussians.means.iter().copied(), VERTICES));
    // For viewers that know only points: linear colors, whereas the harmonics give sRGB.
    let color = |(dc, alpha): (&[f32; 3], f32)| {
        let [r, g, b] = dc.map(|value| srgb_to_linear((value * SH_C0 + 0.5).clamp(0.0, 1.0)));
        [r, g, b, alpha]
    };
    let colors = gaussians.sh_dc.iter().zip(opacities.clone()).map(color);
    name("COLOR_0".into(), accessors.add(colors, VERTICES));
    let quats = gaussians.quats.iter().map(|quat| unit_xyzw(*quat));
    name(format!("{EXTENSION}:ROTATION"), accessors.add(quats, VERTICES));
    let scales = gaussians.log_scales.iter().map(|scale| scale.map(f32::exp));
    name(format!("{EXTENSION}:SCALE"), accessors.add(scales, VERTICES));
    name(format!("{EXTENSION}:OPACITY"), accessors.add(opacities.map(|opacity| [opacity]), VERTICES));
    name(format!("{EXTENSION}:SH_DEGREE_0_COEF_0"), accessors.add(gaussians.sh_dc.iter().copied(), VERTICES));
    for degree in 1..=usize::from(options.sh_degree) {
        for coefficient in 0..2 * degree + 1 {
            let at = degree * degree - 1 + coefficient;
            let rows = gaussians.sh_rest.iter().map(|rest| rest[at]);
            name(format!("{EXTENSION}:SH_DEGREE_{degree}_COEF_{coefficient}"), accessors.add(rows, VERTICES));
        }
    }
    names
}

/// The file around them, without its numbers.
fn scene_json(names: Map<String, Value>, options: &GlbOptions) -> Value {
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
            "attributes": names,
            "extensions": {EXTENSION: {
                "kernel": "ellipse",
                "colorSpace": "srgb_rec709_display",
                "projection": "perspective",
                "sortingMethod": "cameraDistance",
            }},
        }]}],
    })
}
