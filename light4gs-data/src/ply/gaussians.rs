//! The PLY layout of the original 3D Gaussian Splatting, which viewers and editors read.
//!
//! `x y z nx ny nz f_dc_0..2 f_rest_0..44 opacity scale_0..2 rot_0..3`, where `f_rest` is ordered by channel, then by
//! coefficient: coefficient `k` of channel `c` is `f_rest_{c*15+k}`.

use super::property::{Encoding, Property, Scalar};
use super::table::{self, VertexTable};
use crate::error::DataError;
use std::path::Path;

/// Coefficients above degree 0 for each channel, for SH degree 3.
const REST: usize = 15;
const ENCODING: Encoding = Encoding::BinaryLittleEndian;

/// Static Gaussians as plain arrays; every list has the same length `N`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GaussianPly {
    /// `[N, 3]`, world units.
    pub means: Vec<[f32; 3]>,
    /// `[N, 3]`, degree-0 harmonic of red, green, blue.
    pub sh_dc: Vec<[f32; 3]>,
    /// `[N, 15, 3]`, harmonics of degree 1 to 3, by coefficient, then by channel.
    pub sh_rest: Vec<[[f32; 3]; REST]>,
    /// `[N]`, logits; plus or minus infinity for an opacity of 1 or 0.
    pub opacity_logits: Vec<f32>,
    /// `[N, 3]`, natural logarithm of world units; minus infinity for a scale of 0.
    pub log_scales: Vec<[f32; 3]>,
    /// `[N, 4]`, `(w, x, y, z)`, not necessarily normalized.
    pub quats: Vec<[f32; 4]>,
    /// Properties beyond the layout, by name: `[N]` each. Viewers ignore them.
    pub further: Vec<(String, Vec<f32>)>,
}

impl GaussianPly {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Reads a file of any SH degree from 0 to 3; missing higher coefficients are 0. Properties that the layout does
    /// not have become further ones, whatever their values are.
    ///
    /// # Errors
    /// [`DataError::Io`] when it cannot be read; [`DataError::Ply`] when it is damaged, a property is
    /// missing, a value is NaN or infinite where that means nothing, or the number of `f_rest_*` is not 0, 9, 24 or 45.
    pub fn read(path: &Path) -> Result<Self, DataError> {
        let table = table::read(path)?;
        if !table.has("f_dc_0") && !table.has("scale_0") {
            return Err(DataError::ply(
                path,
                "it holds points or a mesh, not Gaussians (it has neither `f_dc_0` nor `scale_0`)",
                "name the file of a trained scene, such as `point_cloud.ply` of 3DGS",
            ));
        }
        let rest = table.properties().iter().filter(|p| p.name.starts_with("f_rest_")).count();
        if ![0, 9, 24, 45].contains(&rest) {
            return Err(DataError::ply(
                path,
                format!("it has {rest} f_rest properties, expected 0, 9, 24 or 45 (SH degree 0 to 3)"),
                "export it again with a whole SH degree",
            ));
        }
        let per_channel = rest / 3;
        let gaussians = Self {
            means: columns(&table, ["x", "y", "z"])?,
            sh_dc: columns(&table, ["f_dc_0", "f_dc_1", "f_dc_2"])?,
            sh_rest: rest_columns(&table, per_channel)?,
            opacity_logits: table.column("opacity")?,
            log_scales: columns(&table, ["scale_0", "scale_1", "scale_2"])?,
            quats: columns(&table, ["rot_0", "rot_1", "rot_2", "rot_3"])?,
            further: further_columns(&table)?,
        };
        match gaussians.first_without_meaning() {
            Some((i, name, value)) => Err(DataError::ply(
                path,
                format!("`{name}` of Gaussian {i} (the first is 0) is {value}, expected a finite number"),
                "remove such Gaussians",
            )),
            None => Ok(gaussians),
        }
    }

    /// Writes the layout above, binary little endian, SH degree 3, normals 0, further properties at the end; the file is
    /// complete or absent, never half-written.
    ///
    /// # Errors
    /// [`DataError::Io`] when it cannot be written; [`DataError::Ply`] when the lists differ in length, or the name of
    /// a further property is one of the layout, occurs twice, or has spaces or control characters.
    pub fn write(&self, path: &Path) -> Result<(), DataError> {
        let properties = self.properties(path)?;
        table::write(path, ENCODING, &properties, self.len(), |i, row| self.fill(i, row))
    }

    /// The bytes that [`GaussianPly::write`] writes; `path` is that of the file they go into, for errors.
    pub(crate) fn bytes(&self, path: &Path) -> Result<Vec<u8>, DataError> {
        let properties = self.properties(path)?;
        let mut bytes = Vec::new();
        let written = table::write_to(&mut bytes, ENCODING, &properties, self.len(), |i, row| self.fill(i, row));
        written.map_err(DataError::io("write", path))?;
        Ok(bytes)
    }

    /// The properties of the layout and the further ones.
    fn properties(&self, path: &Path) -> Result<Vec<Property>, DataError> {
        let lengths =
            [self.sh_dc.len(), self.sh_rest.len(), self.opacity_logits.len(), self.log_scales.len(), self.quats.len()];
        let mut names = names();
        for (name, _) in &self.further {
            if name.is_empty() || name.contains(|c: char| c.is_whitespace() || c.is_control()) || names.contains(name) {
                let problem = format!("a property cannot have the name {name:?}, or stands twice");
                return Err(DataError::ply(path, problem, "give it a name of its own, in one word"));
            }
            names.push(name.clone());
        }
        let further_lengths = self.further.iter().map(|(_, values)| values.len());
        if lengths.into_iter().chain(further_lengths).any(|length| length != self.len()) {
            return Err(DataError::ply(
                path,
                format!("{} means, but the other lists have {lengths:?} entries", self.len()),
                "pass lists of one length",
            ));
        }
        Ok(names.into_iter().map(|name| Property::new(name, Scalar::F32)).collect())
    }

    /// The values of one Gaussian, in the order of the properties.
    fn fill(&self, i: usize, row: &mut Vec<f32>) {
        row.extend(self.means[i]);
        row.extend([0.0; 3]);
        row.extend(self.sh_dc[i]);
        for channel in 0..3 {
            row.extend(self.sh_rest[i].iter().map(|coefficient| coefficient[channel]));
        }
        row.push(self.opacity_logits[i]);
        row.extend(self.log_scales[i]);
        row.extend(self.quats[i]);
        row.extend(self.further.iter().map(|(_, values)| values[i]));
    }

    /// The first Gaussian with a value that is NaN or infinite, the name of the property, and the value. An infinite logit
    /// is an opacity of 0 or 1, and minus infinity the logarithm of a scale of 0.
    fn first_without_meaning(&self) -> Option<(usize, String, f32)> {
        let names = names();
        let has_meaning = |name: &str, value: f32| match name {
            "opacity" => !value.is_nan(),
            _ if name.starts_with("scale_") => value.is_finite() || value == f32::NEG_INFINITY,
            _ => value.is_finite(),
        };
        let mut row = Vec::new();
        (0..self.len()).find_map(|i| {
            row.clear();
            self.fill(i, &mut row);
            let mut named = names.iter().zip(&row);
            let (name, value) = named.find(|(name, value)| !has_meaning(name, **value))?;
            Some((i, name.clone(), *value))
        })
    }
}

/// The 62 property names, in the order of the layout.
fn names() -> Vec<String> {
    let plain = ["x", "y", "z", "nx", "ny", "nz"].map(String::from);
    let numbered = |stem: &'static str, count: usize| (0..count).map(move |i| format!("{stem}_{i}"));
    plain
        .into_iter()
        .chain(numbered("f_dc", 3))
        .chain(numbered("f_rest", 3 * REST))
        .chain(["opacity".to_string()])
        .chain(numbered("scale", 3))
        .chain(numbered("rot", 4))
        .collect()
}

/// Several columns as one array a vertex.
fn columns<const C: usize>(table: &VertexTable, names: [&str; C]) -> Result<Vec<[f32; C]>, DataError> {
    let mut rows = vec![[0.0; C]; table.rows()];
    for (c, name) in names.into_iter().enumerate() {
        for (row, value) in rows.iter_mut().zip(table.column(name)?) {
            row[c] = value;
        }
    }
    Ok(rows)
}

/// Properties that the layout does not have, in the order of the file.
fn further_columns(table: &VertexTable) -> Result<Vec<(String, Vec<f32>)>, DataError> {
    let known = names();
    let further = table.properties().iter().filter(|property| !known.contains(&property.name));
    further.map(|property| Ok((property.name.clone(), table.column(&property.name)?))).collect()
}

/// `f_rest_{channel * per_channel + k}` as `[N, 15, 3]`.
fn rest_columns(table: &VertexTable, per_channel: usize) -> Result<Vec<[[f32; 3]; REST]>, DataError> {
    let mut rows = vec![[[0.0; 3]; REST]; table.rows()];
    for channel in 0..3 {
        for k in 0..per_channel {
            let name = format!("f_rest_{}", channel * per_channel + k);
            for (row, value) in rows.iter_mut().zip(table.column(&name)?) {
                row[k][channel] = value;
            }
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn example(count: usize) -> GaussianPly {
        let value = |i: usize, k: usize| (i * 100 + k) as f32 * 0.25;
        GaussianPly {
            means: (0..count).map(|i| [0, 1, 2].map(|k| value(i, k))).collect(),
            sh_dc: (0..count).map(|i| [3, 4, 5].map(|k| value(i, k))).collect(),
            sh_rest: (0..count)
                .map(|i| std::array::from_fn(|k| std::array::from_fn(|c| value(i, 10 + k * 3 + c))))
                .collect(),
            opacity_logits: (0..count).map(|i| value(i, 60)).collect(),
            log_scales: (0..count).map(|i| [61, 62, 63].map(|k| value(i, k))).collect(),
            quats: (0..count).map(|i| [64, 65, 66, 67].map(|k| value(i, k))).collect(),
            further: Vec::new(),
        }
    }

    #[test]
    fn round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ply");
        for count in [0, 1, 37] {
            let gaussians = example(count);
            gaussians.write(&path).unwrap();
            assert_eq!(GaussianPly::read(&path).unwrap(), gaussians);
        }
    }

    #[test]
    fn further_properties_stand_behind_the_layout() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ply");
        let mut gaussians = example(3);
        gaussians.further =
            vec![("lifetime_0".into(), vec![1.0, 2.0, 3.0]), ("lifetime_1".into(), vec![4.0, 5.0, 6.0])];
        gaussians.write(&path).unwrap();
        assert_eq!(GaussianPly::read(&path).unwrap(), gaussians);
        let table = table::read(&path).unwrap();
        assert_eq!(table.properties()[62].name, "lifetime_0");
        for name in ["lifetime_0", "opacity", "two words", ""] {
            gaussians.further[1].0 = name.into();
            assert!(gaussians.write(&path).is_err(), "{name}");
        }
        gaussians.further = vec![("age".into(), vec![0.0; 2])];
        assert!(gaussians.write(&path).is_err());
    }

    #[test]
    fn the_layout_is_the_original_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ply");
        example(1).write(&path).unwrap();
        let table = table::read(&path).unwrap();
        assert_eq!(table.properties().len(), 62);
        // Coefficient 2 of blue: channel-major.
        assert_eq!(table.column("f_rest_32").unwrap(), [example(1).sh_rest[0][2][2]]);
        assert_eq!(table.properties()[54].name, "opacity");
    }

    #[test]
    fn lower_degrees_are_padded_with_zeros() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ply");
        for (degree, rest) in [(0usize, 0usize), (1, 9), (2, 24)] {
            let properties: Vec<Property> = names()
                .into_iter()
                .filter(|name| name.strip_prefix("f_rest_").is_none_or(|n| n.parse::<usize>().unwrap() < rest))
                .map(|name| Property::new(name, Scalar::F32))
                .collect();
            table::write(&path, Encoding::Ascii, &properties, 1, |_, row| {
                row.extend((0..properties.len()).map(|k| k as f32));
            })
            .unwrap();
            let read = GaussianPly::read(&path).unwrap();
            let used = (degree + 1) * (degree + 1) - 1;
            for (k, coefficient) in read.sh_rest[0].iter().enumerate() {
                for (c, &value) in coefficient.iter().enumerate() {
                    let expected = if k < used { (9 + c * used + k) as f32 } else { 0.0 };
                    assert_eq!(value, expected, "degree {degree} k {k} c {c}");
                }
            }
        }
    }

    #[test]
    fn infinite_logits_and_scales_of_zero_are_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ply");
        let mut gaussians = example(3);
        gaussians.opacity_logits[..2].copy_from_slice(&[f32::INFINITY, f32::NEG_INFINITY]);
        gaussians.log_scales[1][2] = f32::NEG_INFINITY;
        gaussians.write(&path).unwrap();
        assert_eq!(GaussianPly::read(&path).unwrap(), gaussians);
    }

    #[test]
    fn points_are_no_gaussians() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ply");
        let properties = ["x", "y", "z"].map(|name| Property::new(name, Scalar::F32));
        table::write(&path, ENCODING, &properties, 1, |_, row| row.extend([0.0; 3])).unwrap();
        let found = GaussianPly::read(&path).unwrap_err().to_string();
        assert!(found.contains("not Gaussians"), "{found}");
    }

    #[test]
    fn bad_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ply");
        let mut gaussians = example(3);
        gaussians.quats[1][2] = f32::INFINITY;
        gaussians.write(&path).unwrap();
        let found = GaussianPly::read(&path).unwrap_err().to_string();
        assert!(found.contains("g.ply: `rot_2` of Gaussian 1 (the first is 0) is inf"), "{found}");
        for (change, named) in [
            (|g: &mut GaussianPly| g.log_scales[2][1] = f32::INFINITY, "`scale_1` of Gaussian 2"),
            (|g: &mut GaussianPly| g.opacity_logits[2] = f32::NAN, "`opacity` of Gaussian 2"),
            (|g: &mut GaussianPly| g.sh_rest[0][3][2] = f32::NAN, "`f_rest_33` of Gaussian 0"),
        ] as [(fn(&mut GaussianPly), &str); 3]
        {
            let mut gaussians = example(3);
            change(&mut gaussians);
            gaussians.write(&path).unwrap();
            let found = GaussianPly::read(&path).unwrap_err().to_string();
            assert!(found.contains(named), "{found}");
        }
        gaussians.write(&path).unwrap();
        gaussians.quats.pop();
        assert!(gaussians.write(&path).is_err());
        let text = fs::read(&path).unwrap();
        let text = String::from_utf8_lossy(&text).replace("property float f_rest_44\n", "");
        fs::write(&path, text).unwrap();
        assert!(GaussianPly::read(&path).unwrap_err().to_string().contains("44 f_rest"));
    }
}
