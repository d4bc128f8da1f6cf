//! Colored points, at which Gaussians start.

use super::neighbors::mean_squared_distance_to_3_nearest;
use crate::error::DataError;
use crate::ply::{self, Encoding, Property, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// The constant of the spherical harmonic of degree 0: `color = SH_C0 * dc + 0.5`.
pub const SH_C0: f32 = 0.282_094_8;

/// Points with colors; both lists have the same length `N`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// `[N, 3]`, world units.
    pub positions: Vec<[f32; 3]>,
    /// `[N, 3]`, red green blue in `[0, 1]`.
    pub colors: Vec<[f32; 3]>,
}

impl PointCloud {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// `count` points uniform in the cube `[-half_size, half_size]^3` (world units), almost gray:
    /// the degree-0 harmonic of each channel is uniform in `(0, 1/255)`. The same seed gives the same cloud.
    pub fn random(count: usize, half_size: f32, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut cloud = Self::default();
        for _ in 0..count {
            cloud.positions.push([0; 3].map(|_| half_size * rng.random_range(-1.0f32..1.0)));
        }
        for _ in 0..count {
            cloud.colors.push([0; 3].map(|_| SH_C0 * rng.random_range(0.0f32..1.0) / 255.0 + 0.5));
        }
        cloud
    }

    /// Mean squared distance of each point to its three nearest others, see
    /// [`mean_squared_distance_to_3_nearest`]; `N` values, world units squared.
    pub fn mean_squared_distances(&self) -> Vec<f32> {
        mean_squared_distance_to_3_nearest(&self.positions)
    }

    /// The colors as degree-0 harmonic coefficients `[N, 3]`: `(color - 0.5) / SH_C0`.
    pub fn sh_dc(&self) -> Vec<[f32; 3]> {
        self.colors.iter().map(|color| color.map(|c| (c - 0.5) / SH_C0)).collect()
    }

    /// Reads the vertices of a PLY file (ASCII or binary little endian): `x y z`, and `red green blue`
    /// if all three are there (integers are divided by 255); without colors every point is mid-gray.
    ///
    /// # Errors
    /// [`DataError::Ply`] or [`DataError::Io`] when the file is damaged, has no `x y z` or no vertices,
    /// or a position is not finite.
    pub fn read_ply(path: &Path) -> Result<Self, DataError> {
        let table = ply::read(path)?;
        let [x, y, z] = ["x", "y", "z"].map(|name| table.column(name));
        let (x, y, z) = (x?, y?, z?);
        if x.is_empty() {
            return Err(DataError::ply(
                path,
                "it has 0 vertices, expected at least 1",
                "delete the file to start from random points, or export it again",
            ));
        }
        let positions: Vec<[f32; 3]> = (0..x.len()).map(|i| [x[i], y[i], z[i]]).collect();
        if let Some(i) = positions.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(DataError::ply(
                path,
                format!("vertex {i} is at {:?}, expected finite numbers", positions[i]),
                "remove such points",
            ));
        }
        let names = ["red", "green", "blue"];
        let colors = if names.iter().all(|name| table.has(name)) {
            let [r, g, b] = names.map(|name| table.unit_column(name));
            let (r, g, b) = (r?, g?, b?);
            (0..r.len())
                .map(|i| [r[i], g[i], b[i]].map(|v| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.5 }))
                .collect()
        } else {
            vec![[0.5; 3]; positions.len()]
        };
        Ok(Self { positions, colors })
    }

    /// Writes `x y z nx ny nz` (float, normals 0) and `red green blue` (uchar, rounded); the file is
    /// complete or absent, never half-written.
    ///
    /// # Errors
    /// [`DataError::Io`] when it cannot be written; [`DataError::Ply`] when the lists differ in length.
    pub fn write_ply(&self, path: &Path, encoding: Encoding) -> Result<(), DataError> {
        if self.positions.len() != self.colors.len() {
            return Err(DataError::ply(
                path,
                format!("{} positions but {} colors to write", self.positions.len(), self.colors.len()),
                "pass as many colors as positions",
            ));
        }
        let float = ["x", "y", "z", "nx", "ny", "nz"].map(|name| Property::new(name, Scalar::F32));
        let byte = ["red", "green", "blue"].map(|name| Property::new(name, Scalar::U8));
        let properties: Vec<Property> = float.into_iter().chain(byte).collect();
        ply::write(path, encoding, &properties, self.len(), |i, row| {
            row.extend(self.positions[i]);
            row.extend([0.0; 3]);
            row.extend(self.colors[i].map(|c| (c.clamp(0.0, 1.0) * 255.0).round()));
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_clouds_are_seeded_and_in_range() {
        let cloud = PointCloud::random(2000, 1.3, 7);
        assert_eq!(cloud, PointCloud::random(2000, 1.3, 7));
        assert_ne!(cloud, PointCloud::random(2000, 1.3, 8));
        assert_eq!((cloud.len(), cloud.colors.len()), (2000, 2000));
        assert!(cloud.positions.iter().flatten().all(|v| v.abs() <= 1.3));
        assert!(cloud.positions.iter().flatten().any(|v| v.abs() > 1.29));
        let dc = cloud.sh_dc();
        assert!(dc.iter().flatten().all(|v| (-1e-6..1.0 / 255.0 + 1e-6).contains(v)));
    }

    #[test]
    fn round_trip_in_both_encodings() {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = PointCloud::random(100, 1.3, 1);
        for (i, color) in cloud.colors.iter_mut().enumerate() {
            *color = [i as f32 / 255.0, 1.0, 0.0];
        }
        for encoding in [Encoding::Ascii, Encoding::BinaryLittleEndian] {
            let path = folder.path().join("a.ply");
            cloud.write_ply(&path, encoding).unwrap();
            let back = PointCloud::read_ply(&path).unwrap();
            assert_eq!(back.positions, cloud.positions, "{encoding:?}");
            for (a, b) in back.colors.iter().flatten().zip(cloud.colors.iter().flatten()) {
                assert!((a - b).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn an_independent_reader_agrees() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let cloud = PointCloud::random(9, 1.3, 1);
        cloud.write_ply(&path, Encoding::BinaryLittleEndian).unwrap();
        let mut file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let parser = ply_rs_bw::parser::Parser::<ply_rs_bw::ply::DefaultElement>::new();
        let theirs = parser.read_ply(&mut file).unwrap();
        let vertices = &theirs.payload["vertex"];
        assert_eq!(vertices.len(), 9);
        for (vertex, position) in vertices.iter().zip(&cloud.positions) {
            assert_eq!(vertex["y"], ply_rs_bw::ply::Property::Float(position[1]));
        }
    }

    #[test]
    fn clouds_without_use_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        PointCloud::default().write_ply(&path, Encoding::Ascii).unwrap();
        assert!(PointCloud::read_ply(&path).unwrap_err().to_string().contains("0 vertices"));
        let bad = PointCloud { positions: vec![[0.0; 3], [0.0, f32::NAN, 0.0]], colors: vec![[0.5; 3]; 2] };
        bad.write_ply(&path, Encoding::BinaryLittleEndian).unwrap();
        assert!(PointCloud::read_ply(&path).unwrap_err().to_string().contains("vertex 1"));
    }
}
