//! Regularizers of the planes (4DGS: `compute_regulation`).

use burn::tensor::Tensor;
use light4gs_codec::plane_layout::PlaneAxes;
use light4gs_keys::{WEIGHT, keys};

use crate::ops::plane_regularizer::{PlaneWeights, regularize};
use crate::planes::FeaturePlanes;

keys! {
    /// Weights of the space-time regularizers, fine stage only.
    pub struct PlaneRegularizer {
        /// Weight of the mean squared second difference of the space-only planes along their second axis (y or z).
        plane_smoothness: f32 = 1e-4; WEIGHT, "reference";
        /// Weight of the mean squared second difference of the space-time planes along time.
        time_smoothness: f32 = 1e-2; WEIGHT, "reference";
        /// Weight of the mean distance of the space-time planes from 1, which means "no motion".
        time_l1: f32 = 1e-4; WEIGHT, "reference";
    }
}

impl PlaneRegularizer {
    /// The weighted sum of the terms over all planes, `[1]`; planes whose terms have the weight 0 get no gradient.
    pub fn loss(&self, planes: &FeaturePlanes) -> Tensor<1> {
        let device = planes.planes[0].val().device();
        let layout = planes.layout();
        let scale = |scale: usize| {
            let weighted = PlaneAxes::ALL.map(|axes| {
                let (weights, place) = (self.weights_of(axes), layout.find(scale, axes));
                place.filter(|_| weights != PlaneWeights::default()).map(|place| (planes.planes[place].val(), weights))
            });
            weighted.iter().any(Option::is_some).then(|| {
                let weights = weighted.each_ref().map(|plane| plane.as_ref().map(|plane| plane.1).unwrap_or_default());
                // Without weights, a placeholder has no part in the loss.
                let planes =
                    weighted.map(|plane| plane.map_or_else(|| Tensor::zeros([1, 1, 1], &device), |plane| plane.0));
                regularize(planes, weights)
            })
        };
        let sum = (0..layout.scales()).filter_map(scale).reduce(|sum, loss| sum + loss);
        sum.unwrap_or_else(|| Tensor::zeros([1], &device))
    }

    fn weights_of(&self, axes: PlaneAxes) -> PlaneWeights {
        match axes.is_space_time() {
            true => PlaneWeights { smoothness: self.time_smoothness, distance: self.time_l1 },
            false => PlaneWeights { smoothness: self.plane_smoothness, distance: 0.0 },
        }
    }
}
