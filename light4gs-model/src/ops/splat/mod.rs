//! Gaussian splatting as a Burn operation: projection, binning, sorting, blending, and the derivative.

use std::sync::Arc;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, TensorMetadata, backend_extension};
use burn::tensor::TensorData;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};
use light4gs_render::{CHANNELS, GaussianSlices, TileLists, TilePixels, View, assemble, rasterize, splat_backward};

#[cfg(feature = "wgpu")]
use super::fusion::{int_leaf, leaf, resolve};
use super::host::{HostBackend, HostTensor};
use super::{differentiate, for_all_back_ends, for_cpu_back_ends};
use crate::kernels::splat::INPUTS;
pub use crate::kernels::splat::{SplatInputs, SplatKernels, SplatOutputs, SplatView};

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
        #[derive(Debug)]
        struct Splat;

        impl<B: SplatKernels> Backward<B, INPUTS> for Splat {
            type State = B::Saved;

            fn backward(self, ops: Ops<Self::State, INPUTS>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |state, gradient| B::splat_backward(state, gradient).into_array());
            }
        }

        let inputs = inputs.into_array();
        let nodes = inputs.each_ref().map(|input| input.node());
        let inner = SplatInputs::from_array(inputs.map(|input| input.into_primitive()));
        let (outputs, saved) = B::splat_forward(inner, view);
        let rendering = match Splat.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(saved, outputs.rendering),
            OpsKind::UnTracked(prep) => prep.finish(outputs.rendering),
        };
        SplatOutputs { rendering, radii: outputs.radii, intersections: outputs.intersections }
    }
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    inputs: [HostTensor; INPUTS],
    shapes: [Vec<usize>; INPUTS],
    view: View,
    lists: Arc<TileLists>,
    pixels: Arc<Vec<TilePixels>>,
}

pub(super) fn slices(inputs: &[HostTensor; INPUTS]) -> GaussianSlices<'_> {
    let [means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets] = inputs.each_ref().map(|i| i.as_slice());
    GaussianSlices { means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets }
}

fn forward_on_cpu<B: HostBackend>(
    inputs: SplatInputs<B>,
    SplatView { view, .. }: SplatView,
) -> (SplatOutputs<B>, CpuSaved) {
    let inputs = inputs.into_array();
    let device = inputs[0].device();
    let shapes = inputs.each_ref().map(|input| input.shape().iter().copied().collect());
    let inputs = inputs.map(B::to_host);
    let lists = TileLists::build(&slices(&inputs), &view);
    let pixels = rasterize(&lists, &view);
    let rendering = assemble(&pixels, &view);
    let radii = lists.radii();
    let count = radii.len();
    let outputs = SplatOutputs {
        rendering: B::from_values(rendering, [view.camera.height as usize * view.camera.width as usize * CHANNELS]),
        radii: B::int_from_data(TensorData::new(radii, [count]), &device),
        intersections: B::int_from_data(TensorData::from([lists.intersections() as i32]), &device),
    };
    (outputs, CpuSaved { inputs, shapes, view, lists: Arc::new(lists), pixels: Arc::new(pixels) })
}

fn backward_on_cpu<B: HostBackend>(saved: CpuSaved, gradient: FloatTensor<B>) -> SplatInputs<B> {
    let upstream = B::to_host(gradient);
    let g = splat_backward(&slices(&saved.inputs), &saved.view, &saved.lists, &saved.pixels, upstream.as_slice());
    let values = [g.means, g.quats, g.scales, g.opacities, g.sh_dc, g.sh_rest, g.screen_offsets];
    let mut shapes = saved.shapes.into_iter();
    SplatInputs::from_array(
        values.map(|values| B::from_values(values, shapes.next().expect("a shape for every input"))),
    )
}

for_cpu_back_ends! {
    SplatKernels {
        type Saved = CpuSaved;

        fn splat_forward(inputs: SplatInputs<Self>, view: SplatView) -> (SplatOutputs<Self>, CpuSaved) {
            forward_on_cpu(inputs, view)
        }

        fn splat_backward(saved: CpuSaved, gradient: FloatTensor<Self>) -> SplatInputs<Self> {
            backward_on_cpu(saved, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + SplatKernels> SplatKernels for Fusion<B> {
    type Saved = B::Saved;

    fn splat_forward(inputs: SplatInputs<Self>, view: SplatView) -> (SplatOutputs<Self>, B::Saved) {
        let (outputs, saved) = B::splat_forward(resolve_inputs::<B>(inputs), view);
        let SplatOutputs { rendering, radii, intersections } = outputs;
        let [radii, intersections] = [radii, intersections].map(int_leaf::<B>);
        (SplatOutputs { rendering: leaf::<B>(rendering), radii, intersections }, saved)
    }

    fn splat_backward(saved: B::Saved, gradient: FloatTensor<Self>) -> SplatInputs<Self> {
        let gradients = B::splat_backward(saved, resolve::<B>(gradient)).into_array();
        SplatInputs::from_array(gradients.map(leaf::<B>))
    }
}

/// The tensors inside of a fusion stream.
#[cfg(feature = "wgpu")]
pub(super) fn resolve_inputs<B: FusionBackend>(inputs: SplatInputs<Fusion<B>>) -> SplatInputs<B> {
    SplatInputs::from_array(inputs.into_array().map(resolve::<B>))
}
