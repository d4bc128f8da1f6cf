//! The contributions of every Gaussian to one image, as a Burn operation (paper III-B). Not differentiable.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata, backend_extension};
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};
#[cfg(feature = "wgpu")]
use burn_wgpu::CubeBackend;
use light4gs_render::{SCORES, TileLists, significance as significance_of_lists};

use super::for_cpu_back_ends;
#[cfg(feature = "wgpu")]
use super::fusion::leaf;
use super::host::HostBackend;
#[cfg(feature = "wgpu")]
use super::splat::resolve_inputs;
use super::splat::{SplatInputs, SplatView, slices};
#[cfg(feature = "wgpu")]
use crate::gpu::significance_on_gpu;

/// The sums on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait SignificanceOps: Backend {
    /// `[N, 3]`, sums over the pixels that blend each Gaussian: pixels, `T · alpha`, `T · opacity`, with `T` the
    /// transmittance before the Gaussian.
    fn significance(#[extension_type] inputs: SplatInputs<Self>, view: SplatView) -> FloatTensor<Self>;
}

fn significance_on_cpu<B: HostBackend>(inputs: SplatInputs<B>, SplatView { view, .. }: SplatView) -> FloatTensor<B> {
    let inputs = inputs.into_array();
    let count = inputs[0].shape()[0];
    let inputs = inputs.map(B::to_host);
    let lists = TileLists::build(&slices(&inputs), &view);
    B::from_values(significance_of_lists(&lists, &view), [count, SCORES])
}

for_cpu_back_ends! {
    SignificanceOps {
        fn significance(inputs: SplatInputs<Self>, view: SplatView) -> FloatTensor<Self> {
            significance_on_cpu(inputs, view)
        }
    }
}

#[cfg(feature = "wgpu")]
impl SignificanceOps for CubeBackend {
    fn significance(inputs: SplatInputs<Self>, SplatView { view, .. }: SplatView) -> FloatTensor<Self> {
        significance_on_gpu(inputs, view)
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + SignificanceOps> SignificanceOps for Fusion<B> {
    fn significance(inputs: SplatInputs<Self>, view: SplatView) -> FloatTensor<Self> {
        leaf::<B>(B::significance(resolve_inputs::<B>(inputs), view))
    }
}
