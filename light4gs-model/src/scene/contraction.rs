//! The contraction of unbounded space of mip-NeRF 360 (Barron et al. 2022, equation 10).

use burn::tensor::Tensor;

/// Maps points `[N, 3]` into the ball of radius 2: the identity inside the unit ball, `(2 - 1/|x|) x/|x|` outside.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// let points = Tensor::<2>::from_floats([[0.5, 0.0, 0.0], [0.0, 4.0, 0.0]], &Device::flex());
/// let inside = light4gs_model::contract(points).into_data().to_vec::<f32>().unwrap();
/// assert_eq!(inside, [0.5, 0.0, 0.0, 0.0, 1.75, 0.0]);
/// ```
pub fn contract(points: Tensor<2>) -> Tensor<2> {
    // With r = max(|x|, 1) one formula holds in both regions, and so does its derivative.
    let inverse = points.clone().powi_scalar(2).sum_dim(1).clamp_min(1.0).sqrt().recip();
    let factor = (inverse.clone().neg() + 2.0) * inverse;
    points * factor
}
