//! The format of Blender's, instant-ngp's and nerfstudio's transforms: images with poses and intrinsics in JSON.
//!
//! `frames` lists images: `file_path`, `transform_matrix` (camera to world, OpenGL axes), and intrinsics that stand at the
//! top of the file or in the frame: `w h` (pixels), `fl_x fl_y cx cy` (pixels) or `camera_angle_x camera_angle_y`
//! (radians), `camera_model`, and the lens's `k1 ... k6 p1 p2`.

use super::{files, json};
use crate::camera::Intrinsics;
use crate::error::DataError;
use crate::images::image_size;
use crate::lens::{Distortion, Lens};
use glam::{DMat3, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The remedy for a malformed field.
pub(in crate::layouts) const REMEDY: &str = "export the capture again, or correct the field";
/// Camera models that are no fisheyes: their distortion is a function of `x / z` and `y / z`, not of the angle.
const PINHOLES: [&str; 7] =
    ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV", "PERSPECTIVE"];

/// A transforms file, and the folder that its paths are relative to.
pub(in crate::layouts) struct Transforms {
    pub(in crate::layouts) root: PathBuf,
    pub(in crate::layouts) path: PathBuf,
    /// The whole file.
    pub(in crate::layouts) document: Value,
    /// `frames`; at least one.
    pub(in crate::layouts) frames: Vec<Value>,
}

impl Transforms {
    /// Reads a transforms file of the dataset in `root`.
    ///
    /// # Errors
    /// [`DataError`] where the file is missing or no JSON, or has no frame.
    pub(in crate::layouts) fn read(root: &Path, path: PathBuf) -> Result<Self, DataError> {
        let mut document = json::read(&path)?;
        let frames = document.get_mut("frames").and_then(Value::as_array_mut).map(std::mem::take);
        let frames = frames.filter(|list| !list.is_empty()).ok_or_else(|| {
            let found = json::describe(document.get("frames"));
            DataError::field(&path, "frames", format!("{found}, expected a list of at least one frame"), REMEDY)
        })?;
        Ok(Self { root: root.to_path_buf(), path, document, frames })
    }

    /// The path of a frame's image as the file names it: the suffix may be missing, and so may the image.
    pub(in crate::layouts) fn image(&self, i: usize) -> Result<PathBuf, DataError> {
        let (field, value) = (format!("frames[{i}].file_path"), self.frames[i].get("file_path"));
        let name = value.and_then(Value::as_str).filter(|name| !name.is_empty()).ok_or_else(|| {
            let found = json::describe(value);
            let problem = format!("{found}, expected the image's path, relative to the folder");
            DataError::field(&self.path, &field, problem, "add the field to the frame")
        })?;
        files::inside(&self.root, &self.path, &field, name)
    }

    /// The field that holds a frame's pose, for messages.
    pub(in crate::layouts) fn pose_field(i: usize) -> String {
        format!("frames[{i}].transform_matrix")
    }

    /// Rotation from world to camera (OpenCV axes), and the camera's center in world units.
    pub(in crate::layouts) fn pose(&self, i: usize) -> Result<(DMat3, DVec3), DataError> {
        let (field, value) = (Self::pose_field(i), self.frames[i].get("transform_matrix"));
        let rows = json::rows::<3, 4>(&self.path, &field, value, REMEDY)?;
        if let Some(last) = value.and_then(|rows| rows.get(3)) {
            let field = format!("{field}[3]");
            let last = json::numbers::<4>(&self.path, &field, Some(last), REMEDY)?;
            if last.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(found, expected)| (found - expected).abs() > 1e-5) {
                let problem = format!("the last row is {last:?}, expected [0, 0, 0, 1]");
                return Err(DataError::field(&self.path, field, problem, "export rows, not columns, of the matrix"));
            }
        }
        let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
        // OpenGL -> OpenCV: y and z change sign. The inverse of a rotation is its transpose.
        Ok((DMat3::from_cols(column(0), -column(1), -column(2)).transpose(), column(3)))
    }

    /// The name of a field in the frame, or at the top of the file where the frame lacks it, and its value.
    fn value(&self, i: usize, key: &str) -> (String, Option<&Value>) {
        match self.frames[i].get(key) {
            Some(value) => (format!("frames[{i}].{key}"), Some(value)),
            None => (key.to_owned(), self.document.get(key)),
        }
    }

    /// A finite number of a frame or of the whole file; `None` where neither has the field.
    fn number(&self, i: usize, key: &str) -> Result<Option<f64>, DataError> {
        let (field, value) = self.value(i, key);
        value.map(|value| json::finite(&self.path, &field, Some(value), "a finite number", REMEDY)).transpose()
    }

    /// The focal length that follows from an angle of view, pixels.
    fn focal_of_angle(&self, i: usize, key: &str, side: f64) -> Result<Option<f64>, DataError> {
        // As a 32-bit number, as the reference reads it: an angle too small for it is as wrong as 0.
        let Some(angle) = self.number(i, key)?.map(|angle| f64::from(angle as f32)) else { return Ok(None) };
        if !(angle > 0.0 && angle < f64::from(std::f32::consts::PI)) {
            let problem = format!("{angle}, expected the angle of view in radians, between 0 and pi");
            let remedy = "convert degrees to radians, or export the file again";
            return Err(DataError::field(&self.path, self.value(i, key).0, problem, remedy));
        }
        Ok(Some(side / (2.0 * (angle / 2.0).tan())))
    }

    /// Whether the file gives the size of a frame's image.
    pub(in crate::layouts) fn gives_size(&self, i: usize) -> bool {
        ["w", "h"].iter().all(|key| self.value(i, key).1.is_some())
    }

    /// Intrinsics and lens of a frame, whose image is the file `image`.
    pub(in crate::layouts) fn camera(&self, i: usize, image: &Path) -> Result<(Intrinsics, Option<Lens>), DataError> {
        let number = |key: &str| self.number(i, key);
        let (width, height) = match (number("w")?, number("h")?) {
            (Some(width), Some(height)) => (width, height),
            _ => image_size(image).map(|(width, height)| (width.into(), height.into()))?,
        };
        if !(width >= 1.0 && height >= 1.0 && width <= 65_535.0 && height <= 65_535.0) {
            let problem = format!("{width} x {height}, expected 1 to 65535 pixels on each side");
            return Err(DataError::field(&self.path, self.value(i, "w").0, problem, REMEDY));
        }
        let focal = |key: &str, angle: &str, side: f64| match number(key)? {
            Some(focal) => Ok(Some(focal)),
            None => self.focal_of_angle(i, angle, side),
        };
        let (across, down) = (focal("fl_x", "camera_angle_x", width)?, focal("fl_y", "camera_angle_y", height)?);
        let Some(fx) = across.or(down) else {
            let problem = "missing, expected fl_x (pixels) or camera_angle_x (radians)";
            return Err(DataError::field(&self.path, self.value(i, "fl_x").0, problem, REMEDY));
        };
        let fy = down.unwrap_or(fx);
        if !(fx > 0.0 && fy > 0.0) {
            let problem = format!("focal lengths are {fx} x {fy}, expected positive numbers of pixels");
            let key = if fx > 0.0 { "fl_y" } else { "fl_x" };
            return Err(DataError::field(&self.path, self.value(i, key).0, problem, REMEDY));
        }
        let (cx, cy) = (number("cx")?.unwrap_or(width / 2.0), number("cy")?.unwrap_or(height / 2.0));
        let intrinsics = Intrinsics { width: width as u32, height: height as u32, fx, fy, cx, cy };
        Ok((intrinsics, self.lens(i)?))
    }

    fn lens(&self, i: usize) -> Result<Option<Lens>, DataError> {
        let mut k = [0.0; 6];
        for (value, key) in k.iter_mut().zip(["k1", "k2", "k3", "k4", "k5", "k6"]) {
            *value = self.number(i, key)?.unwrap_or(0.0);
        }
        let tangential = [self.number(i, "p1")?.unwrap_or(0.0), self.number(i, "p2")?.unwrap_or(0.0)];
        let (field, model) = self.value(i, "camera_model");
        let model = model.filter(|model| !model.is_null());
        // nerfstudio's `k4` is the next term of the polynomial. OpenCV's is in the denominator, in a model that always
        // has `k5` and `k6`.
        let divides = k[4] != 0.0
            || k[5] != 0.0
            || model.and_then(Value::as_str).is_some_and(|model| model.eq_ignore_ascii_case("FULL_OPENCV"));
        let perspective = if divides || k[3] == 0.0 {
            Distortion::RadialTangential { radial: k, tangential }
        } else {
            Distortion::BrownConrady { radial: [k[0], k[1], k[2], k[3]], tangential }
        };
        let fisheye = matches!(self.value(i, "is_fisheye").1, Some(Value::Bool(true)));
        let name = model.map(|model| model.as_str().unwrap_or("").to_ascii_uppercase());
        let distortion = match name.as_deref() {
            None if !fisheye => perspective,
            Some(name) if PINHOLES.contains(&name) => perspective,
            None | Some("OPENCV_FISHEYE") => Distortion::Fisheye { radial: [k[0], k[1], k[2], k[3]] },
            Some(_) => {
                let (found, known) = (json::describe(model), PINHOLES.join(", "));
                return Err(DataError::field(
                    &self.path,
                    field,
                    format!("{found} is not known, expected {known} or OPENCV_FISHEYE"),
                    "undistort the images first; panoramas must be cut into perspective views",
                ));
            }
        };
        Ok(Lens::new(distortion, 0.0))
    }
}
