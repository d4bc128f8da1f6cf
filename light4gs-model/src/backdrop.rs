//! Gaussians that are drawn with others and not trained: what stands still behind the segment of a take.

use std::sync::Arc;

use burn::tensor::{Device, Tensor};
use light4gs_codec::GaussianArrays;

use crate::scene::gaussians::{ActivatedGaussians, Gaussians};

/// Gaussians that a [`Splatter`](crate::Splatter) draws with those of each call. Clones share their memory.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_data::{Camera, PointCloud};
/// use light4gs_model::{Backdrop, GaussiansConfig, Splatter};
///
/// let device = Device::flex();
/// let ball = |y: f32, color| {
///     let cloud = PointCloud { positions: vec![[0.0, y, 0.0]; 2], colors: vec![color; 2] };
///     GaussiansConfig::new().with_opacity(0.99).init(&cloud, &device)
/// };
/// let backdrop = Backdrop::new(&ball(1.0, [0.0, 0.0, 1.0]).to_arrays(), &device);
/// let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 40, 30);
/// let splatter = Splatter::new([1.0; 3], 0).with_backdrop(Some(backdrop));
/// let rendering = splatter.render(ball(0.0, [1.0, 0.0, 0.0]).tensors(), &camera, None);
/// assert_eq!(rendering.radii.dims(), [2]); // of the red ball, which is in front
/// ```
#[derive(Clone, Debug)]
pub struct Backdrop(Arc<ActivatedGaussians>);

/// Two are equal if they share their memory.
impl PartialEq for Backdrop {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Backdrop {
    /// Gaussians at rest, on a device; they are kept off the tape.
    pub fn new(gaussians: &GaussianArrays, device: &Device) -> Self {
        Self(Arc::new(Gaussians::from_arrays(gaussians, &device.clone().inner()).tensors().inner().activated()))
    }

    /// The number of Gaussians.
    pub fn len(&self) -> usize {
        self.0.means.dims()[0]
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Other Gaussians and their screen offsets, followed by these, and the degree at which all of them are drawn. The others
    /// are drawn at `sh_degree`: their coefficients above it count as 0.
    pub(crate) fn behind(
        &self,
        own: ActivatedGaussians,
        screen_offsets: Tensor<2>,
        sh_degree: usize,
    ) -> (ActivatedGaussians, Tensor<2>, usize) {
        let Self(still) = self;
        let on_tape = own.means.device().is_autodiff() || screen_offsets.device().is_autodiff();
        let kept = (sh_degree + 1).pow(2) - 1;
        let rest = kept.max(still.sh_rest.dims()[1]);
        let pair = Pair { on_tape };
        let all = ActivatedGaussians {
            means: pair.joined(own.means, &still.means),
            quats: pair.joined(own.quats, &still.quats),
            scales: pair.joined(own.scales, &still.scales),
            opacities: pair.joined(own.opacities, &still.opacities),
            sh_dc: pair.joined(own.sh_dc, &still.sh_dc),
            sh_rest: pair.joined(first_of(own.sh_rest, kept, rest), &first_of(still.sh_rest.clone(), rest, rest)),
        };
        let offsets = Tensor::zeros([self.len(), 2], &still.means.device());
        (all, pair.joined(screen_offsets, &offsets), (rest + 1).isqrt() - 1)
    }
}

/// How tensors of Gaussians are put one after the other.
struct Pair {
    /// Whether the first ones are on a device with a tape.
    on_tape: bool,
}

impl Pair {
    fn joined<const D: usize>(&self, own: Tensor<D>, still: &Tensor<D>) -> Tensor<D> {
        let lifted = |tensor: Tensor<D>| match self.on_tape && !tensor.device().is_autodiff() {
            true => Tensor::from_inner(tensor),
            false => tensor,
        };
        Tensor::cat(vec![lifted(own), lifted(still.clone())], 0)
    }
}

/// The first `kept` of coefficients `[N, K, 3]`, or all of fewer, with zeros up to `rest` of them.
fn first_of(coefficients: Tensor<3>, kept: usize, rest: usize) -> Tensor<3> {
    let [count, own, channels] = coefficients.dims();
    let kept = kept.min(own);
    if kept == rest && own == rest {
        return coefficients;
    }
    let zeros = |number: usize| Tensor::zeros([count, number, channels], &coefficients.device());
    // No back end has a part of length 0.
    match (kept, rest - kept) {
        (0, _) => zeros(rest),
        (_, 0) => coefficients.narrow(1, 0, kept),
        (_, more) => Tensor::cat(vec![coefficients.clone().narrow(1, 0, kept), zeros(more)], 1),
    }
}
