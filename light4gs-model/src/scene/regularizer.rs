//! Regularizers of the planes (4DGS: `compute_regulation`).

use burn::tensor::{Tensor, s};
use light4gs_codec::plane_layout::{PLANES_PER_SCALE, SPACE_ONLY_PLANES, SPACE_TIME_PLANES};

use super::hexplane::HexPlane;

/// Mean square of the second difference along the height of a plane `[C, H, W]`: `[1]`. Zero below three rows.
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

fn sum_over(hexplane: &HexPlane, members: [usize; 3], term: impl Fn(Tensor<3>) -> Tensor<1>) -> Tensor<1> {
    let scales = hexplane.planes.chunks_exact(PLANES_PER_SCALE);
    let terms: Vec<_> = scales.flat_map(|scale| members.map(|plane| term(scale[plane].val()))).collect();
    terms.into_iter().reduce(|sum, term| sum + term).expect("a hexplane has at least one scale")
}

/// Smoothness of the space-only planes, `[1]`: second differences along their height, summed over planes and scales.
pub fn plane_smoothness(hexplane: &HexPlane) -> Tensor<1> {
    sum_over(hexplane, SPACE_ONLY_PLANES, second_difference)
}

/// Smoothness in time of the space-time planes, `[1]`: second differences along time, summed over planes and scales.
pub fn time_smoothness(hexplane: &HexPlane) -> Tensor<1> {
    sum_over(hexplane, SPACE_TIME_PLANES, second_difference)
}

/// Departure of the space-time planes from 1, `[1]`: mean absolute difference, summed over planes and scales.
pub fn time_l1(hexplane: &HexPlane) -> Tensor<1> {
    sum_over(hexplane, SPACE_TIME_PLANES, |plane| (plane - 1.0).abs().mean())
}

/// Weights of the three terms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneRegularizer {
    /// Of [`plane_smoothness`].
    pub plane_smoothness: f32,
    /// Of [`time_smoothness`].
    pub time_smoothness: f32,
    /// Of [`time_l1`].
    pub time_l1: f32,
}

impl PlaneRegularizer {
    /// The weighted sum of the terms, `[1]`; terms of weight 0 are not computed.
    pub fn loss(&self, hexplane: &HexPlane) -> Tensor<1> {
        let mut sum = Tensor::zeros([1], &hexplane.planes[0].device());
        if self.plane_smoothness != 0.0 {
            sum = sum + plane_smoothness(hexplane) * self.plane_smoothness;
        }
        if self.time_smoothness != 0.0 {
            sum = sum + time_smoothness(hexplane) * self.time_smoothness;
        }
        if self.time_l1 != 0.0 {
            sum = sum + time_l1(hexplane) * self.time_l1;
        }
        sum
    }
}
