//! COLMAP's binary files: `cameras.bin`, `images.bin`, `points3D.bin`, little endian.

use super::model::{ModelCamera, ModelImage, ModelPoints, REMEDY, model_of_number, unknown_model};
use crate::error::DataError;
use crate::regular_file::read_regular_file;
use std::collections::HashMap;
use std::path::Path;

/// Keypoints and tracks of a large capture are hundreds of megabytes.
const MAX_BYTES: u64 = 4 << 30;
/// No image has a longer name.
const MAX_NAME: usize = 4096;

/// The bytes of a file, and how far they have been read.
struct Reader<'a> {
    path: &'a Path,
    bytes: Vec<u8>,
    at: usize,
}

impl<'a> Reader<'a> {
    fn open(path: &'a Path) -> Result<Self, DataError> {
        let bytes = read_regular_file(path, MAX_BYTES).map_err(DataError::io("read", path))?;
        Ok(Self { path, bytes, at: 0 })
    }

    fn take(&mut self, count: usize, field: &str) -> Result<&[u8], DataError> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        let Some(end) = end else {
            let problem = format!("the file ends at byte {}, in the middle of it", self.bytes.len());
            return Err(DataError::field(self.path, field, problem, REMEDY));
        };
        let start = std::mem::replace(&mut self.at, end);
        Ok(&self.bytes[start..end])
    }

    fn array<const N: usize>(&mut self, field: &str) -> Result<[u8; N], DataError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, field)?);
        Ok(out)
    }

    fn u32(&mut self, field: &str) -> Result<u32, DataError> {
        self.array(field).map(u32::from_le_bytes)
    }

    fn u64(&mut self, field: &str) -> Result<u64, DataError> {
        self.array(field).map(u64::from_le_bytes)
    }

    fn floats<const N: usize>(&mut self, field: &str) -> Result<[f64; N], DataError> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.array(field).map(f64::from_le_bytes)?;
        }
        Ok(out)
    }

    /// A count of entries of at least `size` bytes each, which the rest of the file must be able to hold.
    fn count(&mut self, field: &str, size: usize) -> Result<usize, DataError> {
        let count = self.u64(field)?;
        let most = (self.bytes.len() - self.at) / size;
        if count > most as u64 {
            let problem = format!("{count}, but the rest of the file holds at most {most}: it is truncated");
            return Err(DataError::field(self.path, field, problem, REMEDY));
        }
        Ok(count as usize)
    }

    fn name(&mut self, field: &str) -> Result<String, DataError> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().take(MAX_NAME).position(|byte| *byte == 0);
        let name = end.and_then(|end| std::str::from_utf8(&rest[..end]).ok()).map(str::to_owned);
        let Some(name) = name else {
            let problem = "expected a name in UTF-8 that ends with a zero byte";
            return Err(DataError::field(self.path, field, problem, REMEDY));
        };
        self.at += name.len() + 1;
        Ok(name)
    }

    fn end(&self) -> Result<(), DataError> {
        let rest = self.bytes.len() - self.at;
        if rest == 0 {
            return Ok(());
        }
        let problem = format!("{rest} bytes follow the last entry");
        Err(DataError::field(self.path, "(end of the file)", problem, REMEDY))
    }
}

pub(super) fn cameras(path: &Path) -> Result<HashMap<u32, ModelCamera>, DataError> {
    let mut file = Reader::open(path)?;
    let count = file.count("number of cameras", 24)?;
    let mut cameras = HashMap::with_capacity(count);
    for i in 0..count {
        let field = format!("camera {i}");
        let id = file.u32(&field)?;
        let number = file.u32(&field)? as i32;
        let size = (file.u64(&field)?, file.u64(&field)?);
        let (model, parameters) =
            model_of_number(number).ok_or_else(|| unknown_model(path, &field, &number.to_string()))?;
        let mut values = Vec::with_capacity(parameters);
        for _ in 0..parameters {
            values.extend(file.floats::<1>(&field)?);
        }
        cameras.insert(id, ModelCamera::new(path, &field, model, size, &values)?);
    }
    file.end()?;
    Ok(cameras)
}

pub(super) fn images(path: &Path) -> Result<Vec<ModelImage>, DataError> {
    let mut file = Reader::open(path)?;
    let count = file.count("number of images", 73)?;
    let mut images = Vec::with_capacity(count);
    for i in 0..count {
        let field = format!("image {i}");
        file.u32(&field)?;
        let quaternion = file.floats(&field)?;
        let translation = file.floats(&field)?;
        let camera = file.u32(&field)?;
        let name = file.name(&format!("{field}, name"))?;
        // Keypoints: two coordinates and the number of a point.
        let keypoints = file.count(&format!("{field}, number of keypoints"), 24)?;
        file.take(24 * keypoints, &field)?;
        images.push(ModelImage::new(path, &field, name, quaternion, translation, camera)?);
    }
    file.end()?;
    Ok(images)
}

/// The points. Those that are not finite are counted and left out.
pub(super) fn points(path: &Path) -> Result<ModelPoints, DataError> {
    let mut file = Reader::open(path)?;
    let count = file.count("number of points", 51)?;
    let mut points = ModelPoints::default();
    for i in 0..count {
        let field = format!("point {i}");
        file.u64(&field)?;
        let position = file.floats::<3>(&field)?.map(|v| v as f32);
        let color = file.array::<3>(&field)?.map(|v| f32::from(v) / 255.0);
        let [error] = file.floats::<1>(&field)?;
        let track = file.count(&format!("{field}, length of the track"), 8)?;
        file.take(8 * track, &field)?;
        if position.iter().all(|v| v.is_finite()) {
            points.cloud.positions.push(position);
            points.cloud.colors.push(color);
            points.errors += error;
        } else {
            points.not_finite += 1;
        }
    }
    file.end()?;
    Ok(points)
}
