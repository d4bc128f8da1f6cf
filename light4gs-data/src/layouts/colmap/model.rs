//! A sparse model of COLMAP in memory, and the meaning of its camera models.

use crate::camera::Intrinsics;
use crate::error::DataError;
use crate::lens::{Distortion, Lens};
use crate::points::PointCloud;
use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The remedy for a malformed file.
pub(super) const REMEDY: &str = "export the model again with `colmap model_converter`";

/// A camera with its lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelCamera {
    pub(crate) intrinsics: Intrinsics,
    pub(crate) lens: Option<Lens>,
}

/// A posed image.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ModelImage {
    /// Path below the folder of images.
    pub(crate) name: String,
    /// World to camera, OpenCV axes.
    pub(crate) rotation: DMat3,
    /// World units.
    pub(crate) center: DVec3,
    pub(crate) camera: u32,
}

/// The points of a model.
#[derive(Debug, Default)]
pub(super) struct ModelPoints {
    pub(super) cloud: PointCloud,
    /// The sum of their reprojection errors, pixels.
    pub(super) errors: f64,
    /// Points without a place, which are not in the cloud.
    pub(super) not_finite: usize,
}

/// A sparse model.
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) cameras: HashMap<u32, ModelCamera>,
    /// In the file's order.
    pub(crate) images: Vec<ModelImage>,
    /// May be empty.
    pub(crate) points: PointCloud,
    /// Mean reprojection error of the points, pixels; `None` without points.
    pub(crate) error: Option<f64>,
    /// Points without a place, which are not in the cloud.
    pub(crate) points_not_finite: usize,
    /// The file of the images, for messages.
    pub(crate) images_file: PathBuf,
}

/// COLMAP's camera models: number in binary files, name in text files, count of parameters.
const MODELS: [(i32, &str, usize); 11] = [
    (0, "SIMPLE_PINHOLE", 3),
    (1, "PINHOLE", 4),
    (2, "SIMPLE_RADIAL", 4),
    (3, "RADIAL", 5),
    (4, "OPENCV", 8),
    (5, "OPENCV_FISHEYE", 8),
    (6, "FULL_OPENCV", 12),
    (7, "FOV", 5),
    (8, "SIMPLE_RADIAL_FISHEYE", 4),
    (9, "RADIAL_FISHEYE", 5),
    (10, "THIN_PRISM_FISHEYE", 12),
];

/// The name and the number of parameters of a model number.
pub(super) fn model_of_number(number: i32) -> Option<(&'static str, usize)> {
    MODELS.iter().find(|model| model.0 == number).map(|model| (model.1, model.2))
}

/// The name and the number of parameters of a model name.
pub(super) fn model_of_name(name: &str) -> Option<(&'static str, usize)> {
    MODELS.iter().find(|model| model.1 == name).map(|model| (model.1, model.2))
}

/// The error about a model that is not known.
pub(super) fn unknown_model(path: &Path, field: &str, found: &str) -> DataError {
    let names: Vec<&str> = MODELS.iter().map(|model| model.1).collect();
    DataError::field(
        path,
        field,
        format!("camera model `{found}` is not known, expected one of {}", names.join(", ")),
        "undistort the images with `colmap image_undistorter`, which writes PINHOLE cameras",
    )
}

impl ModelCamera {
    /// A camera of a known model with as many parameters as it has.
    pub(super) fn new(
        path: &Path,
        field: &str,
        model: &str,
        (width, height): (u64, u64),
        p: &[f64],
    ) -> Result<Self, DataError> {
        let bad = |problem: String| DataError::field(path, field, problem, REMEDY);
        if let Some(i) = p.iter().position(|v| !v.is_finite()) {
            return Err(bad(format!("parameter {i} of {model} is {}, expected a finite number", p[i])));
        }
        if !(1..=65_535).contains(&width) || !(1..=65_535).contains(&height) {
            return Err(bad(format!("its size is {width} x {height}, expected 1 to 65535 pixels on each side")));
        }
        let one_focal =
            matches!(model, "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE");
        let (fx, fy, cx, cy, k) =
            if one_focal { (p[0], p[0], p[1], p[2], &p[3..]) } else { (p[0], p[1], p[2], p[3], &p[4..]) };
        let radial = |radial: [f64; 6], tangential| Distortion::RadialTangential { radial, tangential };
        let distortion = match (model, k) {
            ("SIMPLE_RADIAL", &[k1]) => radial([k1, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]),
            ("RADIAL", &[k1, k2]) => radial([k1, k2, 0.0, 0.0, 0.0, 0.0], [0.0; 2]),
            ("OPENCV", &[k1, k2, p1, p2]) => radial([k1, k2, 0.0, 0.0, 0.0, 0.0], [p1, p2]),
            ("FULL_OPENCV", &[k1, k2, p1, p2, k3, k4, k5, k6]) => radial([k1, k2, k3, k4, k5, k6], [p1, p2]),
            ("OPENCV_FISHEYE", &[k1, k2, k3, k4]) => Distortion::Fisheye { radial: [k1, k2, k3, k4] },
            ("SIMPLE_RADIAL_FISHEYE", &[k1]) => Distortion::Fisheye { radial: [k1, 0.0, 0.0, 0.0] },
            ("RADIAL_FISHEYE", &[k1, k2]) => Distortion::Fisheye { radial: [k1, k2, 0.0, 0.0] },
            ("FOV", &[omega]) => Distortion::FieldOfView { omega },
            ("THIN_PRISM_FISHEYE", &[k1, k2, p1, p2, k3, k4, sx1, sy1]) => {
                Distortion::ThinPrismFisheye { radial: [k1, k2, k3, k4], tangential: [p1, p2], prism: [sx1, sy1] }
            }
            _ => radial([0.0; 6], [0.0; 2]),
        };
        let intrinsics = Intrinsics { width: width as u32, height: height as u32, fx, fy, cx, cy };
        Ok(Self { intrinsics, lens: Lens::new(distortion, 0.0) })
    }
}

impl ModelImage {
    /// An image from COLMAP's quaternion (w, x, y, z; world to camera) and translation.
    pub(super) fn new(
        path: &Path,
        field: &str,
        name: String,
        [w, x, y, z]: [f64; 4],
        translation: [f64; 3],
        camera: u32,
    ) -> Result<Self, DataError> {
        let quaternion = DQuat::from_xyzw(x, y, z, w);
        let length = quaternion.length();
        if !(length > 1e-6 && length.is_finite() && translation.iter().all(|v| v.is_finite())) {
            let problem = format!("quaternion {:?}, translation {translation:?}: expected a finite pose", [w, x, y, z]);
            return Err(DataError::field(path, field, problem, REMEDY));
        }
        let rotation = DMat3::from_quat(quaternion.normalize());
        let center = -(rotation.transpose() * DVec3::from(translation));
        Ok(Self { name, rotation, center, camera })
    }
}
