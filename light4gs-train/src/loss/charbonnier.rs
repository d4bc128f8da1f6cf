//! The Charbonnier loss, a smooth L1 (Charbonnier et al. 1994; Lai et al. 2018, LapSRN, equation 3).

use burn::tensor::Tensor;

use super::{Loss, LossInput};
use crate::keys::{Bounds::Number, keys};

keys! {
    /// The mean of `sqrt(difference² + epsilon²)`: L1 where images differ by more than epsilon, squared below.
    pub struct CharbonnierLoss {
        /// Difference of colors, 0 to 1, at which the loss changes from squared to linear.
        epsilon: f32 = 1e-3; Number { least: 1e-4, most: 1.0 }, "LapSRN";
    }
}

impl Loss for CharbonnierLoss {
    fn loss(&self, view: LossInput) -> Tensor<1> {
        let squares = (view.image - view.truth).powi_scalar(2);
        (squares + self.epsilon * self.epsilon).sqrt().mean()
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use light4gs_data::{Camera, Frame};

    use super::*;
    use crate::stage::Stage;

    #[test]
    fn it_is_linear_far_away_and_squared_nearby() {
        let device = Device::flex();
        let camera = Camera::look_at([4.0, 0.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 1, 1);
        let frame = Frame::without_image("view".to_owned(), camera, 0.0);
        let loss = CharbonnierLoss { epsilon: 0.01 };
        let of = |difference: f32| -> f32 {
            let image = Tensor::<1>::from_floats([0.25 + difference; 3], &device).reshape([1, 1, 3]);
            let truth = Tensor::<1>::from_floats([0.25; 3], &device).reshape([1, 1, 3]);
            let plane = Tensor::<2>::zeros([1, 1], &device);
            let view = LossInput {
                image,
                alpha: plane.clone(),
                depth: plane,
                truth,
                frame: &frame,
                stage: Stage::Fine,
                iteration: 1,
            };
            loss.loss(view).into_scalar()
        };
        assert!((of(0.0) - 0.01).abs() < 1e-6);
        assert!((of(0.5) - 0.5).abs() < 2e-4 && (of(-0.5) - 0.5).abs() < 2e-4);
        // sqrt(e² + d²) = e + d² / 2e for small d.
        assert!((of(0.001) - 0.01005).abs() < 1e-5);
    }
}
