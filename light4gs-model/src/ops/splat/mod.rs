//! Gaussian splatting as a Burn operation: projection, binning, sorting, blending, and the derivative.

pub(super) mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Autodiff, Backend, ExtensionType, backend_extension};
use light4gs_data::Camera;
use light4gs_render::View;

use super::{for_all_back_ends, recorded_outputs};

/// The differentiable inputs, in the order in which gradients are registered.
#[derive(ExtensionType)]
pub struct SplatInputs<B: Backend> {
    /// `[N, 3]`, world units.
    pub means: FloatTensor<B>,
    /// `[N, 4]` as (w, x, y, z), normalized inside.
    pub quats: FloatTensor<B>,
    /// `[N, 3]`, standard deviations in world units, or their natural logarithms: see [`SplatView::with_logarithms`].
    pub scales: FloatTensor<B>,
    /// `[N, 1]` in [0, 1], or their logits.
    pub opacities: FloatTensor<B>,
    /// `[N, 1, 3]`.
    pub sh_dc: FloatTensor<B>,
    /// `[N, K, 3]`, K >= (degree + 1)^2 - 1.
    pub sh_rest: FloatTensor<B>,
    /// `[N, 2]`, added to the screen position in units of half the image.
    pub screen_offsets: FloatTensor<B>,
}

/// Tensors of [`SplatInputs`].
const INPUTS: usize = 7;

impl<B: Backend> SplatInputs<B> {
    pub(super) fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.means, self.quats, self.scales, self.opacities, self.sh_dc, self.sh_rest, self.screen_offsets]
    }

    pub(super) fn from_array(
        [means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets]: [FloatTensor<B>; INPUTS],
    ) -> Self {
        Self { means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets }
    }
}

/// The outputs.
#[derive(ExtensionType)]
pub struct SplatOutputs<B: Backend> {
    /// `[H, W, 3]`: color over the background.
    pub image: FloatTensor<B>,
    /// `[H, W]` in [0, 1].
    pub alpha: FloatTensor<B>,
    /// `[H, W]`, world units, not divided by alpha.
    pub depth: FloatTensor<B>,
    /// `[N]` in pixels; 0 = not on the screen, -1 = not finite or without orientation, so not drawn.
    pub radii: IntTensor<B>,
    /// `[1]`: pairs of a Gaussian and a cell of the image that it touches. If there was room for fewer, the image is incomplete.
    pub intersections: IntTensor<B>,
}

/// Gradients of image, alpha and depth; `None` if nothing depends on one. At least one is there.
pub type OfPixels<B> = [Option<FloatTensor<B>>; 3];

/// A back end's kernels. [`SplatOps`] adds the dispatch and the tape.
pub trait SplatKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Saved: Clone + Debug + Send + 'static;

    /// Draws the image.
    fn splat_forward(inputs: SplatInputs<Self>, view: SplatView) -> (SplatOutputs<Self>, Self::Saved);

    /// Gradients of all inputs from those of image, alpha and depth.
    fn splat_backward(saved: Self::Saved, gradients: OfPixels<Self>) -> SplatInputs<Self>;
}

/// Camera, background and active SH degree of one image.
#[derive(Clone, Copy, Debug)]
pub struct SplatView {
    pub(crate) view: View,
    /// Intersections that there is room for; `None`: for all. Only a GPU has to know.
    #[cfg_attr(not(feature = "wgpu"), allow(dead_code))]
    pub(crate) room: Option<usize>,
    /// Gaussians that need gradients: the first ones; `None`: all. The gradients of the others may be zero.
    pub(crate) trained: Option<usize>,
    /// Whether scales are logarithms and opacities logits.
    pub(crate) logarithms: bool,
}

impl SplatView {
    /// The image of `camera` over `background` (red, green, blue). `sh_degree` (0 to 3) is the highest degree of the spherical
    /// harmonics that is used; `sh_rest` must have at least its `(degree + 1)^2 - 1` coefficients.
    pub fn new(camera: Camera, background: [f32; 3], sh_degree: usize) -> Self {
        Self { view: View { camera, background, sh_degree }, room: None, trained: None, logarithms: false }
    }

    /// With logarithms in place of scales and logits in place of opacities, which the operation turns into scales and opacities by
    /// [`bounded_exponential`](crate::ops::activation::bounded_exponential) and
    /// [`sigmoid`](crate::ops::activation::sigmoid): on a GPU each would be a launch.
    pub fn with_logarithms(self) -> Self {
        Self { logarithms: true, ..self }
    }
}

/// Splatting on every back end that has [`SplatKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait SplatOps: Backend {
    /// Draws Gaussians.
    fn splat(#[extension_type] inputs: SplatInputs<Self>, view: SplatView) -> SplatOutputs<Self>;
}

for_all_back_ends! {
    SplatOps with SplatKernels {
        fn splat(inputs: SplatInputs<Self>, view: SplatView) -> SplatOutputs<Self> {
            Self::splat_forward(inputs, view).0
        }
    }
}

impl<B: SplatOps + SplatKernels, C: CheckpointStrategy> SplatOps for Autodiff<B, C> {
    fn splat(inputs: SplatInputs<Self>, view: SplatView) -> SplatOutputs<Self> {
        let inputs = inputs.into_array();
        let nodes = inputs.each_ref().map(|input| input.node());
        let inner = SplatInputs::from_array(inputs.map(|input| input.into_primitive()));
        let (outputs, saved) = B::splat_forward(inner, view);
        let SplatOutputs { image, alpha, depth, radii, intersections } = outputs;
        let pixels = ([image, alpha, depth], saved);
        let [image, alpha, depth] = recorded_outputs::<B, C, _, _, _>(nodes, pixels, |saved, gradients| {
            B::splat_backward(saved, gradients).into_array()
        });
        SplatOutputs { image, alpha, depth, radii, intersections }
    }
}
