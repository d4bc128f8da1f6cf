//! Regularizers of the planes (4DGS: `compute_regulation`).

use burn::tensor::{Tensor, s};
use light4gs_keys::{WEIGHT, keys};

use crate::planes::FeaturePlanes;

/// Mean square of the second difference along the height of a plane `[C, H, W]`: `[1]`. Zero with fewer than three
/// rows.
pub fn second_difference(plane: Tensor<3>) -> Tensor<1> {
    let height = plane.dims()[1];
    if height < 3 {
        return Tensor::zeros([1], &plane.device());
    }
    let middle = plane.clone().slice(s![.., 1..height - 1, ..]);
    let above = plane.clone().slice(s![.., 0..height - 2, ..]);
    let below = plane.slice(s![.., 2..height, ..]);
    (above + below - middle * 2.0).powi_scalar(2).mean()
}

/// The sum of a term over the space-time planes, or over the space-only planes; 0 where there are none.
fn sum_over(planes: &FeaturePlanes, space_time: bool, term: impl Fn(Tensor<3>) -> Tensor<1>) -> Tensor<1> {
    let shapes = planes.layout().planes().iter().zip(&planes.planes);
    let terms =
        shapes.filter(|(shape, _)| shape.axes.is_space_time() == space_time).map(|(_, plane)| term(plane.val()));
    let sum = terms.reduce(|sum, term| sum + term);
    sum.unwrap_or_else(|| Tensor::zeros([1], &planes.planes[0].device()))
}

/// Smoothness of the space-only planes, `[1]`: second differences along their height, summed over planes and scales.
pub fn plane_smoothness(planes: &FeaturePlanes) -> Tensor<1> {
    sum_over(planes, false, second_difference)
}

/// Smoothness in time of the space-time planes, `[1]`: second differences along time, summed over planes and scales.
pub fn time_smoothness(planes: &FeaturePlanes) -> Tensor<1> {
    sum_over(planes, true, second_difference)
}

/// Distance of the space-time planes from 1, `[1]`: mean absolute difference, summed over planes and scales.
pub fn time_l1(planes: &FeaturePlanes) -> Tensor<1> {
    sum_over(planes, true, |plane| (plane - 1.0).abs().mean())
}

keys! {
    /// Weights of the space-time regularizers, fine stage only.
    pub struct PlaneRegularizer {
        /// Squared second difference of the space-only planes.
        plane_smoothness: f32 = 1e-4; WEIGHT, "reference";
        /// Squared second difference over time of the space-time planes.
        time_smoothness: f32 = 1e-2; WEIGHT, "reference";
        /// Distance of the space-time planes from 1, which means "no motion".
        time_l1: f32 = 1e-4; WEIGHT, "reference";
    }
}

impl PlaneRegularizer {
    /// The weighted sum of the terms, `[1]`; terms of weight 0 are not computed.
    pub fn loss(&self, planes: &FeaturePlanes) -> Tensor<1> {
        let mut sum = Tensor::zeros([1], &planes.planes[0].device());
        if self.plane_smoothness != 0.0 {
            sum = sum + plane_smoothness(planes) * self.plane_smoothness;
        }
        if self.time_smoothness != 0.0 {
            sum = sum + time_smoothness(planes) * self.time_smoothness;
        }
        if self.time_l1 != 0.0 {
            sum = sum + time_l1(planes) * self.time_l1;
        }
        sum
    }
}
