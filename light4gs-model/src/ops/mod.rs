//! Custom operations as Burn backend extensions.
//!
//! Each has a trait with the operation, which is dispatched at run time to the device's back end and recorded by
//! autodiff. A differentiable one also has a trait with the forward and backward kernels that a back end implements:
//! `NdArray` and `Flex` with the kernels of `cpu/`, `CubeBackend` with those of `gpu/`, and `Fusion<B>` with those of
//! the back end that it wraps.

// Burn 0.22 deprecates its `ndarray` back end in favor of `flex`; we serve both.
#![allow(deprecated)]

pub mod activation;
pub mod adam;
pub mod columns;
#[cfg(feature = "wgpu")]
mod fusion;
mod host;
pub mod image_difference;
pub mod linear;
pub mod lower_bound;
pub mod node_poses;
pub mod node_regularizer;
pub mod normal_cdf;
pub mod plane_query;
pub mod rate;
pub mod significance;
pub mod skinning;
pub mod splat;

use std::fmt::Debug;

use burn::backend::Backend;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::Ops;
use burn::backend::tensor::FloatTensor;

/// The backward pass of an operation whose parents on the tape all get a gradient: `derivative` makes these from its state and
/// from the gradient of its output.
fn differentiate<B: Backend, S: Clone + Debug + Send + 'static, const N: usize>(
    ops: Ops<S, N>,
    tape: &mut Gradients,
    derivative: impl FnOnce(S, FloatTensor<B>) -> [FloatTensor<B>; N],
) {
    let gradient = tape.consume::<B>(&ops.node);
    for (parent, gradient) in ops.parents.into_iter().zip(derivative(ops.state, gradient)) {
        if let Some(parent) = parent {
            tape.register::<B>(parent.id, gradient);
        }
    }
}

/// Implements a trait with the same items for each CPU back end of this build.
macro_rules! for_cpu_back_ends {
    ($trait:ident { $($items:item)* }) => {
        #[cfg(feature = "ndarray")]
        impl $trait for burn::backend::NdArray { $($items)* }
        #[cfg(feature = "flex")]
        impl $trait for burn::backend::Flex { $($items)* }
    };
}

/// Implements an operation with the same items, which may call `$kernels`, for each back end of this build.
macro_rules! for_all_back_ends {
    ($trait:ident with $kernels:ident { $($items:item)* }) => {
        $crate::ops::for_cpu_back_ends!($trait { $($items)* });
        #[cfg(feature = "wgpu")]
        impl $trait for burn_wgpu::CubeBackend { $($items)* }
        #[cfg(feature = "wgpu")]
        impl<B: burn_fusion::FusionBackend + $kernels> $trait for burn_fusion::Fusion<B> { $($items)* }
    };
}

use {for_all_back_ends, for_cpu_back_ends};
