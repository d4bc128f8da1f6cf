//! The corrections of one view, on the tape.

use burn::tensor::{Device, Gradients, Tensor};
use light4gs_data::{Camera, Frame};
use light4gs_model::GaussianTensors;

use super::exposure::{Exposure, exposed};
use super::poses::{Pose, turned};

/// Corrections of a view as numbers.
#[derive(Clone, Copy, Debug)]
pub struct ViewCorrection {
    /// Logarithms of the gains, and offsets.
    pub(super) exposure: Option<[f32; 6]>,
    pub(super) pose: Option<Pose>,
    /// Offset of the time, in intervals between two frames.
    pub(super) intervals: Option<f32>,
    /// Whether the offset is learned from this view.
    pub(super) learns_time: bool,
    /// From one time to the next.
    pub(super) interval: f32,
    pub(super) background: [f32; 3],
}

/// The gradient of a view's loss with respect to its corrections; `None` for those that it has not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientOfView {
    pub(super) exposure: Option<[f32; 6]>,
    pub(super) pose: Option<[f32; 6]>,
    pub(super) time: Option<f32>,
}

impl ViewCorrection {
    /// The frame with its corrected camera and time.
    pub fn frame(&self, frame: &Frame) -> Frame {
        let camera = self.pose.map_or(frame.camera, |pose| pose.corrected(&frame.camera));
        let time = self.intervals.map_or(frame.time, |intervals| frame.time + intervals * self.interval);
        Frame { camera, time: time.clamp(0.0, 1.0), ..frame.clone() }
    }

    /// The scene's radiance from an image `[H, W, 3]`: without its exposure.
    pub fn radiance(&self, image: Tensor<3>) -> Tensor<3> {
        let Some(values) = self.exposure else { return image };
        let Exposure { gain, offset } = Exposure::of(values);
        let [gain, offset] =
            [gain, offset].map(|values| Tensor::<1>::from_floats(values, &image.device()).reshape([1, 1, 3]));
        (image - offset) / gain
    }

    /// Half an interval before and after a corrected time, as far as the scene lasts.
    pub fn around(&self, time: f32) -> [f32; 2] {
        [-0.5, 0.5].map(|share| (time + share * self.interval).clamp(0.0, 1.0))
    }

    /// The same as tensors on an autodiff device, with a tape of their own.
    pub fn on_tape(&self, device: &Device) -> LearnedView {
        let leaf = |values: &[f32]| Tensor::<1>::from_floats(values, device).require_grad();
        LearnedView {
            exposure: self.exposure.map(|values| leaf(&values)),
            pose: self.pose.map(|_| leaf(&[0.0; 6])),
            time: self.intervals.filter(|_| self.learns_time).map(|_| leaf(&[0.0])),
            correction: *self,
        }
    }

    /// The gradient from the numbers of [`LearnedView::gradient`], times a factor.
    pub fn gradient(&self, numbers: &[f32], factor: f32) -> GradientOfView {
        let part = |from: usize| std::array::from_fn(|k| factor * numbers[from + k]);
        GradientOfView {
            exposure: self.exposure.map(|_| part(0)),
            pose: self.pose.map(|pose| pose.gradient(part(6))),
            time: self.intervals.filter(|_| self.learns_time).map(|_| factor * numbers[12]),
        }
    }
}

/// The tensors that are learned for a view. Those of pose and time are further corrections, whose value is 0.
#[derive(Debug)]
pub struct LearnedView {
    correction: ViewCorrection,
    exposure: Option<Tensor<1>>,
    pose: Option<Tensor<1>>,
    time: Option<Tensor<1>>,
}

impl LearnedView {
    /// The Gaussians at the corrected time, with the derivative by the time, except that of the higher spherical harmonics.
    /// `at` gives the Gaussians at any time, without a tape.
    pub fn at_time(
        &self,
        gaussians: GaussianTensors,
        time: f32,
        at: impl Fn(f32) -> GaussianTensors,
    ) -> GaussianTensors {
        let Some(further) = &self.time else { return gaussians };
        let [before, after] = self.correction.around(time);
        if before == after {
            return gaussians;
        }
        // By finite differences: fields are made to be quick, not to be differentiated by time, and are often piecewise
        // linear between frames.
        let (first, second) = (at(before), at(after));
        let scale = self.correction.interval / (after - before);
        fn along<const D: usize>(
            value: Tensor<D>,
            [first, second]: [Tensor<D>; 2],
            scale: f32,
            further: &Tensor<1>,
        ) -> Tensor<D> {
            let change = Tensor::from_inner((second - first) * scale);
            value + change * further.clone().reshape([1; D])
        }
        GaussianTensors {
            means: along(gaussians.means, [first.means, second.means], scale, further),
            log_scales: along(gaussians.log_scales, [first.log_scales, second.log_scales], scale, further),
            quats: along(gaussians.quats, [first.quats, second.quats], scale, further),
            opacity_logits: along(
                gaussians.opacity_logits,
                [first.opacity_logits, second.opacity_logits],
                scale,
                further,
            ),
            sh_dc: along(gaussians.sh_dc, [first.sh_dc, second.sh_dc], scale, further),
            sh_rest: gaussians.sh_rest,
            further: gaussians.further,
        }
    }

    /// The Gaussians with the derivative by the camera's pose. `given` is the camera of the dataset, `corrected` the one
    /// that draws.
    pub fn turned(&self, gaussians: GaussianTensors, given: &Camera, corrected: &Camera) -> GaussianTensors {
        match &self.pose {
            Some(further) => turned(gaussians, further, corrected, given.center().to_array()),
            None => gaussians,
        }
    }

    /// An image `[H, W, 3]` with its alpha `[H, W]` as the camera shows it.
    pub fn exposed(&self, image: Tensor<3>, alpha: Tensor<2>) -> Tensor<3> {
        match &self.exposure {
            Some(values) => exposed(image, alpha, values.clone(), self.correction.background),
            None => image,
        }
    }

    /// The gradients after a backward pass, `[13]`: exposure, pose, time; 0 for what is not learned, or has no effect. `None`
    /// where nothing is learned.
    pub fn gradient(&self, tape: &mut Gradients) -> Option<Tensor<1>> {
        let leaves = [(&self.exposure, 6), (&self.pose, 6), (&self.time, 1)];
        let device = leaves.iter().find_map(|(leaf, _)| leaf.as_ref())?.device().inner();
        let of = |(leaf, length): (&Option<Tensor<1>>, usize)| {
            let gradient = leaf.as_ref().and_then(|leaf| leaf.grad_remove(tape));
            gradient.unwrap_or_else(|| Tensor::zeros([length], &device))
        };
        Some(Tensor::cat(leaves.map(of).to_vec(), 0))
    }
}
