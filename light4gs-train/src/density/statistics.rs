//! Statistics of each Gaussian over views.

use burn::tensor::{Device, Int, Tensor, TensorData};

/// Statistics of each Gaussian over the rendered views since the last densification.
#[derive(Clone, Debug)]
pub struct DensityStatistics {
    /// `[N]`: sum of the norms of the screen-space gradients.
    pub gradient_sum: Tensor<1>,
    /// `[N]`: views in which the Gaussian was on the screen.
    pub views: Tensor<1>,
    /// `[N]` in pixels.
    pub largest_radius: Tensor<1>,
}

impl DensityStatistics {
    /// For `count` Gaussians.
    pub fn new(count: usize, device: &Device) -> Self {
        let zeros = || Tensor::zeros([count], device);
        Self { gradient_sum: zeros(), views: zeros(), largest_radius: zeros() }
    }

    /// Adds a view: screen-space gradients `[N, 2]` and radii `[N]`, both off the tape.
    pub fn add(&mut self, screen_gradient: Tensor<2>, radii: Tensor<1, Int>) {
        let visible = radii.clone().greater_elem(0).float();
        let norm = screen_gradient.powi_scalar(2).sum_dim(1).sqrt().squeeze_dim::<1>(1);
        self.gradient_sum = self.gradient_sum.clone() + norm * visible.clone();
        self.views = self.views.clone() + visible;
        self.largest_radius = self.largest_radius.clone().max_pair(radii.float());
    }

    /// Keeps the rows where `keep` is set.
    pub fn keep(&mut self, keep: &[bool]) {
        let rows: Vec<i64> = (0..keep.len() as i64).filter(|row| keep[*row as usize]).collect();
        let rows = Tensor::<1, Int>::from_data(TensorData::new(rows.clone(), [rows.len()]), &self.views.device());
        for tensor in [&mut self.gradient_sum, &mut self.views, &mut self.largest_radius] {
            *tensor = tensor.clone().select(0, rows.clone());
        }
    }

    /// `[N]`: mean gradient over the views, 0 for Gaussians that were never seen.
    pub fn mean_gradients(&self) -> Vec<f32> {
        (self.gradient_sum.clone() / self.views.clone().clamp_min(1.0)).into_data().iter().collect()
    }
}
