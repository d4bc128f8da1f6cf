//! The scene's own coordinates: principal axes of the initial cloud, standardized and contracted (paper III-A).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::CoordinateMapping;
use light4gs_keys::Bounds::Flag;
use light4gs_keys::keys;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::ops::plane_coordinates::{Standardization, plane_coordinates};

/// Principal component analysis of a point cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pca {
    /// Mean of the points, world units.
    pub mean: [f32; 3],
    /// Unit axes, by descending variance; the component of largest magnitude of each is positive.
    pub axes: [[f32; 3]; 3],
    /// Standard deviation along each axis, world units.
    pub std: [f32; 3],
}

/// A standard deviation below this share of the largest one is raised to it, so that flat clouds can be standardized.
const MIN_RELATIVE_STD: f64 = 1e-4;

impl Pca {
    /// Analyses points with the unbiased covariance (N - 1). Fewer than two points, or points that all coincide, give
    /// the identity around their mean.
    pub fn fit(points: &[[f32; 3]]) -> Self {
        let count = points.len() as f64;
        let vector = |p: &[f32; 3]| Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
        let mean = points.iter().map(vector).sum::<Vector3<f64>>() / count.max(1.0);
        let covariance = points.iter().map(|p| vector(p) - mean).map(|d| d * d.transpose()).sum::<Matrix3<f64>>()
            / (count - 1.0).max(1.0);
        let mean = [mean.x as f32, mean.y as f32, mean.z as f32];
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
        let largest = eigen.eigenvalues[order[0]].max(0.0).sqrt();
        if !(largest.is_finite() && largest > 0.0) {
            return Self { mean, axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], std: [1.0; 3] };
        }
        let axes = order.map(|i| {
            let axis = eigen.eigenvectors.column(i);
            let sign = axis[axis.iamax()].signum();
            [(axis[0] * sign) as f32, (axis[1] * sign) as f32, (axis[2] * sign) as f32]
        });
        let std = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt().max(MIN_RELATIVE_STD * largest) as f32);
        Self { mean, axes, std }
    }

    /// The same mean, with the world's axes and the unbiased standard deviation along each of them.
    fn along_world_axes(points: &[[f32; 3]]) -> Self {
        let mean = Self::fit(points).mean;
        let count = (points.len() as f64 - 1.0).max(1.0);
        let spread: [f64; 3] = std::array::from_fn(|axis| {
            let squares = points.iter().map(|p| (f64::from(p[axis]) - f64::from(mean[axis])).powi(2));
            (squares.sum::<f64>() / count).sqrt()
        });
        let largest = spread.into_iter().fold(0.0, f64::max);
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        if !(largest.is_finite() && largest > 0.0) {
            return Self { mean, axes, std: [1.0; 3] };
        }
        Self { mean, axes, std: spread.map(|std| std.max(MIN_RELATIVE_STD * largest) as f32) }
    }

    /// Distance of a world point from the mean, in standard deviations.
    fn standardized_norm(&self, point: [f32; 3]) -> f64 {
        let along = |axis: usize| {
            let offset = (0..3).map(|k| f64::from(point[k] - self.mean[k]) * f64::from(self.axes[axis][k]));
            offset.sum::<f64>() / f64::from(self.std[axis])
        };
        (0..3).map(|axis| along(axis).powi(2)).sum::<f64>().sqrt()
    }
}

keys! {
    /// The mapping from world coordinates to the coordinates of the planes (paper III-A).
    pub struct CoordinatesConfig {
        /// Whether the planes lie along the principal axes of the initial cloud. If off, they lie along the world's
        /// axes, each scaled by the cloud's standard deviation along this axis.
        pca: bool = true; Flag, "paper";
        /// Whether points more than one standard deviation away from the cloud's center are contracted. If off, the
        /// whole cloud is scaled into the ball of radius 1, which is half as wide as the planes.
        contraction: bool = true; Flag, "paper";
    }
}

impl CoordinatesConfig {
    /// The analysis of a cloud with these settings.
    pub fn fit(&self, points: &[[f32; 3]]) -> Pca {
        let mut pca = if self.pca { Pca::fit(points) } else { Pca::along_world_axes(points) };
        if !self.contraction {
            let farthest = points.iter().map(|point| pca.standardized_norm(*point)).fold(0.0, f64::max);
            if farthest.is_finite() && farthest > 0.0 {
                pca.std = pca.std.map(|std| (f64::from(std) * farthest) as f32);
            }
        }
        pca
    }
}

/// Maps world points to the planes' coordinates. Fixed once it is made: none of its tensors is trained.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::{Pca, SceneCoordinates};
///
/// let device = Device::flex();
/// let cloud = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5]];
/// let frame = SceneCoordinates::new(&Pca::fit(&cloud), &device);
/// let coordinates = frame.normalize(Tensor::from_floats(cloud, &device));
/// assert_eq!(coordinates.dims(), [4, 3]);
/// assert!(coordinates.abs().max().into_scalar::<f32>() <= 1.0);
/// ```
#[derive(Module, Debug)]
pub struct SceneCoordinates {
    /// `[1, 3]`
    mean: Param<Tensor<2>>,
    /// `[3, 3]`: column j is axis j.
    axes: Param<Tensor<2>>,
    /// `[1, 3]`
    std: Param<Tensor<2>>,
    /// From standardized coordinates to those of the planes.
    #[module(skip)]
    mapping: CoordinateMapping,
}

impl SceneCoordinates {
    /// The coordinates from an analysis, with the paper's mapping.
    pub fn new(pca: &Pca, device: &Device) -> Self {
        let columns: Vec<f32> = (0..9).map(|k| pca.axes[k % 3][k / 3]).collect();
        let constant = |values: Vec<f32>, rows: usize| {
            let tensor = Tensor::<2>::from_data(TensorData::new(values, [rows, 3]), device);
            Param::from_tensor(tensor).set_require_grad(false)
        };
        Self {
            mean: constant(pca.mean.to_vec(), 1),
            axes: constant(columns, 3),
            std: constant(pca.std.to_vec(), 1),
            mapping: CoordinateMapping::default(),
        }
    }

    /// The same coordinates with another mapping, for scenes that other programs have trained.
    pub fn with_mapping(mut self, mapping: CoordinateMapping) -> Self {
        self.mapping = mapping;
        self
    }

    /// From standardized coordinates to those of the planes.
    pub fn mapping(&self) -> CoordinateMapping {
        self.mapping
    }

    /// Coordinates in [-1, 1]: standardized, by default contracted into the ball of radius 2 and halved. `[N, 3]` to `[N, 3]`.
    pub fn normalize(&self, points: Tensor<2>) -> Tensor<2> {
        plane_coordinates(points, self.standardization(), self.mapping, None)
    }

    /// The coordinates of [`Self::normalize`] and a time: `[N, 3]` to `[N, 4]`, as hexplanes are queried. `time` is in [0, 1],
    /// and its coordinate in [-1, 1].
    pub fn normalize_at(&self, points: Tensor<2>, time: f32) -> Tensor<2> {
        plane_coordinates(points, self.standardization(), self.mapping, Some(2.0 * time - 1.0))
    }

    fn standardization(&self) -> Standardization {
        Standardization { mean: self.mean.val(), axes: self.axes.val(), std: self.std.val() }
    }

    /// The field's time for a time of the scene, both in [0, 1].
    pub fn field_time(&self, time: f32) -> f32 {
        self.mapping.time(time)
    }

    /// The analysis from which the coordinates were made.
    pub fn pca(&self) -> Pca {
        let values = |tensor: Tensor<2>| tensor.into_data().iter::<f32>().collect::<Vec<_>>();
        let triple = |v: Vec<f32>| [v[0], v[1], v[2]];
        let axes = values(self.axes.val());
        Pca {
            mean: triple(values(self.mean.val())),
            axes: std::array::from_fn(|j| [axes[j], axes[3 + j], axes[6 + j]]),
            std: triple(values(self.std.val())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOUD: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [4.0, 4.0, 0.0], [-4.0, -4.0, 0.5], [1.0, -1.0, 0.0], [3.0, 5.0, -2.0]];

    #[test]
    fn without_pca_the_axes_are_the_world_s() {
        let pca = CoordinatesConfig { pca: false, contraction: true }.fit(&CLOUD);
        assert_eq!(pca.axes, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(pca.mean, Pca::fit(&CLOUD).mean);
        let variance: f32 = CLOUD.iter().map(|p| (p[0] - pca.mean[0]).powi(2)).sum::<f32>() / 4.0;
        assert!((pca.std[0] - variance.sqrt()).abs() < 1e-5);
        assert_eq!(CoordinatesConfig::default().fit(&CLOUD), Pca::fit(&CLOUD));
    }

    #[test]
    fn without_contraction_the_cloud_lies_where_nothing_is_contracted() {
        for pca in [false, true] {
            let fitted = CoordinatesConfig { pca, contraction: false }.fit(&CLOUD);
            let farthest = CLOUD.iter().map(|p| fitted.standardized_norm(*p)).fold(0.0, f64::max);
            assert!((farthest - 1.0).abs() < 1e-5, "{farthest}");
        }
    }

    #[test]
    fn degenerate_clouds_have_coordinates() {
        for cloud in [vec![], vec![[1.0; 3]], vec![[2.0; 3]; 4], vec![[f32::NAN; 3], [0.0; 3]]] {
            for (pca, contraction) in [(false, false), (false, true), (true, false)] {
                let fitted = CoordinatesConfig { pca, contraction }.fit(&cloud);
                assert!(fitted.std.iter().all(|std| *std > 0.0), "{cloud:?}: {fitted:?}");
            }
        }
    }
}
