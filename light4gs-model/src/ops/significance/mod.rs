//! The contributions of every Gaussian to one image, as a Burn operation (paper III-B). Not differentiable.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, backend_extension};

use super::splat::{SplatInputs, SplatView};

/// The sums on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait SignificanceOps: Backend {
    /// `[N, 3]`, sums over the pixels that blend each Gaussian: pixels, `T · alpha`, `T · opacity`, with `T` the
    /// transmittance before the Gaussian.
    fn significance(#[extension_type] inputs: SplatInputs<Self>, view: SplatView) -> FloatTensor<Self>;
}
