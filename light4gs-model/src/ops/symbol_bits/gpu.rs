//! The bits of symbols on a GPU.

use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::CubeBackend;
use light4gs_shaders::{SYMBOL_BITS, SYMBOL_BITS_BACKWARD};

use super::{BelowBound, SymbolBitsKernels, SymbolBitsOps, symbol_bits};
use crate::gpu::{Kernel, elementwise};
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "symbol_bits", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [SYMBOL_BITS, SYMBOL_BITS_BACKWARD].map(Kernel::new).into()
}

impl SymbolBitsOps for CubeBackend {
    fn symbol_bits(likelihoods: FloatTensor<Self>, bound: f32, _: BelowBound) -> FloatTensor<Self> {
        elementwise(SYMBOL_BITS, [likelihoods], &[bound])
    }
}

impl SymbolBitsKernels for CubeBackend {
    fn symbol_bits_backward(
        likelihoods: FloatTensor<Self>,
        bound: f32,
        below: BelowBound,
        upstream: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let stays = f32::from(below == BelowBound::Stays);
        elementwise(SYMBOL_BITS_BACKWARD, [likelihoods, upstream], &[bound, stays])
    }
}

impl<B: FusionBackend + SymbolBitsOps> SymbolBitsOps for Fusion<B> {
    fn symbol_bits(likelihoods: FloatTensor<Self>, bound: f32, below: BelowBound) -> FloatTensor<Self> {
        leaf::<B>(B::symbol_bits(resolve::<B>(likelihoods), bound, below))
    }
}

impl<B: FusionBackend + SymbolBitsKernels> SymbolBitsKernels for Fusion<B> {
    fn symbol_bits_backward(
        likelihoods: FloatTensor<Self>,
        bound: f32,
        below: BelowBound,
        upstream: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        leaf::<B>(B::symbol_bits_backward(resolve::<B>(likelihoods), bound, below, resolve::<B>(upstream)))
    }
}

/// Probabilities above and below the bound, with both gradients.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let likelihoods = numbers.leaf(1, 2600, 0.01, 1.0);
    let mut values = Vec::new();
    for below in [BelowBound::Rises, BelowBound::Stays] {
        let bits = symbol_bits(likelihoods.clone(), 0.11, below);
        values.extend(numbers.with_gradients(bits, std::slice::from_ref(&likelihoods)));
    }
    values
}
