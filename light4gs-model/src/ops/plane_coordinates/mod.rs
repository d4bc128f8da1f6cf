//! Coordinates of the planes (paper III-A), as a Burn operation: points standardized along the principal axes of the initial cloud,
//! contracted into a ball and scaled into [-1, 1], with the time beside them where it is asked for.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;
use light4gs_codec::CoordinateMapping;

use super::{for_all_back_ends, recorded};

/// Points, and the analysis of the initial cloud.
#[derive(Debug, ExtensionType)]
pub struct PointTensors<B: Backend> {
    /// `[N, 3]`, world units.
    pub points: FloatTensor<B>,
    /// `[1, 3]`, world units. A constant, like the two others of the analysis.
    pub mean: FloatTensor<B>,
    /// `[3, 3]`: column j is axis j.
    pub axes: FloatTensor<B>,
    /// `[1, 3]`: standard deviations along the axes, world units.
    pub std: FloatTensor<B>,
}

impl<B: Backend> PointTensors<B> {
    fn into_array(self) -> [FloatTensor<B>; 4] {
        [self.points, self.mean, self.axes, self.std]
    }
}

/// What happens to standardized coordinates.
#[derive(Clone, Copy, Debug)]
pub struct PlaneMapping {
    /// Whether space is contracted, then scale and offset.
    pub mapping: CoordinateMapping,
    /// A fourth coordinate, the same for all points.
    pub time: Option<f32>,
}

impl PlaneMapping {
    /// Numbers of a row of the output.
    fn width(&self) -> usize {
        3 + usize::from(self.time.is_some())
    }
}

/// A back end's kernels. [`PlaneCoordinateOps`] adds the dispatch and the tape.
pub trait PlaneCoordinateKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Mapped: Clone + std::fmt::Debug + Send + 'static;

    /// Coordinates `[N, 3]`, or `[N, 4]` with a time.
    fn plane_coordinates_forward(
        points: PointTensors<Self>,
        mapping: PlaneMapping,
    ) -> (FloatTensor<Self>, Self::Mapped);

    /// From the gradient of the coordinates to that of the points.
    fn plane_coordinates_backward(saved: Self::Mapped, gradient: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Coordinates on every back end that has [`PlaneCoordinateKernels`], differentiable by the points under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait PlaneCoordinateOps: Backend {
    /// Coordinates `[N, 3]`, or `[N, 4]` with a time; see [`plane_coordinates`].
    fn plane_coordinates(#[extension_type] points: PointTensors<Self>, mapping: PlaneMapping) -> FloatTensor<Self>;
}

for_all_back_ends! {
    PlaneCoordinateOps with PlaneCoordinateKernels {
        fn plane_coordinates(points: PointTensors<Self>, mapping: PlaneMapping) -> FloatTensor<Self> {
            Self::plane_coordinates_forward(points, mapping).0
        }
    }
}

impl<B: PlaneCoordinateOps + PlaneCoordinateKernels, C: CheckpointStrategy> PlaneCoordinateOps for Autodiff<B, C> {
    fn plane_coordinates(points: PointTensors<Self>, mapping: PlaneMapping) -> FloatTensor<Self> {
        let node = points.points.node();
        let [points, mean, axes, std] = points.into_array().map(|tensor| tensor.into_primitive());
        let mapped = B::plane_coordinates_forward(PointTensors { points, mean, axes, std }, mapping);
        recorded::<B, C, _, _>([node], mapped, |saved, gradient| [B::plane_coordinates_backward(saved, gradient)])
    }
}

/// The analysis of the initial cloud.
#[derive(Clone, Debug)]
pub struct Standardization {
    /// `[1, 3]`: mean, world units.
    pub mean: Tensor<2>,
    /// `[3, 3]`: column j is axis j.
    pub axes: Tensor<2>,
    /// `[1, 3]`: standard deviations along the axes, world units.
    pub std: Tensor<2>,
}

/// Coordinates `[N, 3]` of `points [N, 3]` in world units, with a fourth one where a time is given:
///
/// ```text
/// s_j = axis_j · (point - mean) / std_j
/// s = s (2 - 1/r) / r,   r = max(|s|, 1)        if space is contracted (Barron et al. 2022, equation 10)
/// coordinates = s · scale + offset
/// ```
///
/// Only the points get a gradient.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_codec::CoordinateMapping;
/// use light4gs_model::ops::plane_coordinates::{Standardization, plane_coordinates};
///
/// let device = Device::flex();
/// let row = |values: [f32; 3]| Tensor::<2>::from_floats([values], &device);
/// let standardization = Standardization {
///     mean: row([1.0, 0.0, 0.0]),
///     axes: Tensor::eye(3, &device),
///     std: row([2.0, 1.0, 1.0]),
/// };
/// let points = Tensor::from_floats([[2.0, 0.0, 0.0], [1.0, 4.0, 0.0]], &device);
/// let coordinates = plane_coordinates(points, standardization, CoordinateMapping::default(), Some(0.5));
/// let values = coordinates.into_data().to_vec::<f32>().unwrap();
/// assert_eq!(values, [0.25, 0.0, 0.0, 0.5, 0.0, 0.875, 0.0, 0.5]);
/// ```
///
/// # Panics
/// If the shapes do not belong together.
pub fn plane_coordinates(
    points: Tensor<2>,
    standardization: Standardization,
    mapping: CoordinateMapping,
    time: Option<f32>,
) -> Tensor<2> {
    let Standardization { mean, axes, std } = standardization;
    assert_eq!(points.dims()[1], 3, "points must be [N, 3]");
    assert_eq!([mean.dims(), axes.dims(), std.dims()], [[1, 3], [3, 3], [1, 3]], "mean, axes and std of three axes");
    Tensor::from_dispatch(Dispatch::plane_coordinates(
        PointTensors {
            points: points.into_dispatch(),
            mean: mean.into_dispatch(),
            axes: axes.into_dispatch(),
            std: std.into_dispatch(),
        },
        PlaneMapping { mapping, time },
    ))
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;

    /// Axes that are turned, points within and beyond the ball that contraction does not change.
    fn scene(device: &Device) -> (Tensor<2>, Standardization) {
        let points = [[0.3, -0.1, 0.2], [4.0, 1.0, -3.0], [-0.5, 6.0, 0.0], [1.0, 0.5, -0.2], [0.2, 0.3, 9.0]];
        let standardization = Standardization {
            mean: Tensor::from_floats([[0.1, -0.2, 0.3]], device),
            axes: Tensor::from_floats([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]], device),
            std: Tensor::from_floats([[2.0, 1.0, 0.5]], device),
        };
        (Tensor::from_floats(points, device), standardization)
    }

    fn mappings() -> [CoordinateMapping; 2] {
        let other = CoordinateMapping {
            contracts: false,
            scale: [0.1, 0.2, 0.3],
            offset: [0.0, 0.1, -0.1],
            ..CoordinateMapping::default()
        };
        [CoordinateMapping::default(), other]
    }

    /// The same formula, in double precision.
    fn expected(point: [f64; 3], mapping: &CoordinateMapping) -> [f64; 3] {
        let offset = [point[0] - 0.1, point[1] + 0.2, point[2] - 0.3];
        let standardized =
            [(0.6 * offset[0] + 0.8 * offset[1]) / 2.0, -0.8 * offset[0] + 0.6 * offset[1], offset[2] / 0.5];
        let radius = standardized.iter().map(|value| value * value).sum::<f64>().sqrt();
        let factor = if mapping.contracts && radius > 1.0 { (2.0 - 1.0 / radius) / radius } else { 1.0 };
        let [scale, shift] = [mapping.scale, mapping.offset].map(|values| values.map(f64::from));
        std::array::from_fn(|axis| factor * standardized[axis] * scale[axis] + shift[axis])
    }

    #[test]
    fn coordinates_and_gradients_are_those_of_the_formula() {
        let device = Device::flex().autodiff();
        let (points, standardization) = scene(&device);
        let rows: Vec<f32> = points.clone().into_data().to_vec().unwrap();
        let weights = [0.7, -1.3, 0.4, 5.0];
        for (mapping, time) in mappings().into_iter().flat_map(|mapping| [(mapping, None), (mapping, Some(-0.25))]) {
            let leaf = points.clone().require_grad();
            let found = plane_coordinates(leaf.clone(), standardization.clone(), mapping, time);
            let width = found.dims()[1];
            let values: Vec<f32> = found.clone().into_data().to_vec().unwrap();
            let weights_row = Tensor::<2>::from_floats([weights], &device).slice([0..1, 0..width]);
            let gradients = leaf.grad(&(found * weights_row).sum().backward()).unwrap().into_data();
            let gradients: Vec<f32> = gradients.to_vec().unwrap();
            for (row, point) in rows.chunks(3).enumerate() {
                let point: [f64; 3] = std::array::from_fn(|axis| f64::from(point[axis]));
                for (axis, value) in expected(point, &mapping).into_iter().enumerate() {
                    let close = (f64::from(values[width * row + axis]) - value).abs() < 1e-6;
                    assert!(close, "point {row}, axis {axis}, {mapping:?}");
                }
                assert!(time.is_none_or(|time| values[width * row + 3] == time));
                for axis in 0..3 {
                    let loss = |step: f64| {
                        let mut moved = point;
                        moved[axis] += step;
                        expected(moved, &mapping).iter().zip(weights).map(|(value, weight)| value * weight).sum::<f64>()
                    };
                    let slope = (loss(1e-5) - loss(-1e-5)) / 2e-5;
                    let close = (f64::from(gradients[3 * row + axis]) - slope).abs() < 1e-5;
                    assert!(close, "gradient of point {row}, axis {axis}, {mapping:?}: {slope}");
                }
            }
        }
    }
}
