//! Custom operations as Burn backend extensions, each in a folder of its own:
//!
//! | file | contents |
//! |---|---|
//! | `mod.rs` | the operation, its shapes, its place on autodiff's tape, and the trait that a back end implements |
//! | `cpu.rs`, `cpu_backward.rs` | its kernels for `NdArray` and `Flex`, on plain slices; those of splatting are in `light4gs-render` |
//! | `gpu.rs` | its launches for `CubeBackend`, what `Fusion` does around them, and the operation for checks (`OPERATION`): a list of its kernels, and calls that launch them |
//! | `shaders/<operation>/` | its kernels in WGSL |
//!
//! The trait of the operation itself is dispatched at run time to the device's back end and recorded by autodiff. A differentiable
//! operation also has a trait with the kernels that a back end implements for both directions. The other files of this folder serve
//! all operations: access to the memory of CPU tensors (`host.rs`), arguments with any number of tensors (`tensor_list.rs`), fusion streams (`fusion.rs`), checks (`sample.rs`). The shared
//! code for GPUs is in `gpu/`.

// Burn 0.22 deprecates its `ndarray` back end in favor of `flex`; we serve both.
#![allow(deprecated)]

pub mod activation;
pub mod adam;
pub mod attribute_bits;
pub mod columns;
pub mod deformation_network;
pub mod density_likelihood;
#[cfg(feature = "wgpu")]
mod fusion;
mod host;
pub mod image_difference;
pub mod linear;
pub mod lower_bound;
pub mod neighborhoods;
pub mod node_poses;
pub mod node_regularizer;
pub mod noise_gradient;
pub mod normal_likelihood;
pub mod plane_convolution;
pub mod plane_coordinates;
pub mod plane_query;
pub mod plane_regularizer;
#[cfg(feature = "wgpu")]
mod sample;
pub mod significance;
pub mod skinning;
pub mod splat;
pub mod sums;
pub mod symbol_bits;
pub mod tensor_list;
pub mod time_means;
pub mod uniform_noise;

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, NodeGuard, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[cfg(feature = "wgpu")]
pub use sample::GpuOperation;

#[cfg(feature = "wgpu")]
use crate::gpu::{self, Kernel};

/// The operations that have kernels on a GPU.
#[cfg(feature = "wgpu")]
pub const ON_GPU: &[GpuOperation] = &[
    activation::gpu::OPERATION,
    adam::gpu::OPERATION,
    attribute_bits::gpu::OPERATION,
    columns::gpu::OPERATION,
    deformation_network::gpu::OPERATION,
    density_likelihood::gpu::OPERATION,
    image_difference::gpu::OPERATION,
    lower_bound::gpu::OPERATION,
    neighborhoods::gpu::OPERATION,
    node_poses::gpu::OPERATION,
    node_regularizer::gpu::OPERATION,
    noise_gradient::gpu::OPERATION,
    normal_likelihood::gpu::OPERATION,
    plane_convolution::gpu::OPERATION,
    plane_coordinates::gpu::OPERATION,
    plane_query::gpu::OPERATION,
    plane_regularizer::gpu::OPERATION,
    significance::gpu::OPERATION,
    skinning::gpu::OPERATION,
    splat::gpu::OPERATION,
    sums::gpu::OPERATION,
    symbol_bits::gpu::OPERATION,
    time_means::gpu::OPERATION,
    uniform_noise::gpu::OPERATION,
];

/// Every kernel that the program can launch, on any adapter and with any configuration.
#[cfg(feature = "wgpu")]
pub fn kernels() -> Vec<Kernel> {
    gpu::kernels().into_iter().chain(ON_GPU.iter().flat_map(|operation| (operation.kernels)())).collect()
}

/// Makes the gradients of an operation's parents from what it saved and from the gradient of its output.
type Derivative<B, S, const N: usize> = fn(S, FloatTensor<B>) -> [FloatTensor<B>; N];

/// An operation on the tape.
#[derive(Debug)]
struct Recorded<B: Backend, S, const N: usize>(Derivative<B, S, N>);

impl<B: Backend, S: Clone + Debug + Send + 'static, const N: usize> Backward<B, N> for Recorded<B, S, N> {
    type State = S;

    fn backward(self, ops: Ops<S, N>, tape: &mut Gradients, _: &mut Checkpointer) {
        let gradient = tape.consume::<B>(&ops.node);
        for (parent, gradient) in ops.parents.into_iter().zip(self.0(ops.state, gradient)) {
            if let Some(parent) = parent {
                tape.register::<B>(parent.id, gradient);
            }
        }
    }
}

/// The output of an operation as a tensor on the tape, if one of its parents is on the tape. All parents get a gradient.
fn recorded<B: Backend, C: CheckpointStrategy, S: Clone + Debug + Send + 'static, const N: usize>(
    parents: [NodeGuard; N],
    (output, saved): (FloatTensor<B>, S),
    derivative: Derivative<B, S, N>,
) -> FloatTensor<Autodiff<B, C>> {
    match Recorded::<B, S, N>(derivative).prepare::<C>(parents).compute_bound().stateful() {
        OpsKind::Tracked(prep) => prep.finish(saved, output),
        OpsKind::UnTracked(prep) => prep.finish(output),
    }
}

/// Makes the gradients of an operation's parents from what it saved and from the gradients of those of its outputs on which the loss
/// depends.
type DerivativeOfAll<B, S, const K: usize, const N: usize> = fn(S, [Option<FloatTensor<B>>; K]) -> [FloatTensor<B>; N];

/// Gradients of the outputs of an operation, until its backward pass takes them.
type Gathered<B, const K: usize> = Arc<Mutex<[Option<FloatTensor<B>>; K]>>;

/// One of several outputs of an operation on the tape: keeps its gradient for the backward pass of the operation.
#[derive(Debug)]
struct Gathering<const K: usize>;

impl<B: Backend, const K: usize> Backward<B, 1> for Gathering<K> {
    type State = (Gathered<B, K>, usize);

    fn backward(self, ops: Ops<Self::State, 1>, tape: &mut Gradients, _: &mut Checkpointer) {
        let gradient = tape.consume::<B>(&ops.node);
        let (gathered, output) = ops.state;
        let mut gathered = gathered.lock().unwrap_or_else(PoisonError::into_inner);
        let first = gathered.iter().all(Option::is_none);
        gathered[output] = Some(gradient.clone());
        let [operation] = ops.parents;
        // The tape asks for some gradient of the operation; its backward pass reads `gathered` instead.
        if let Some(operation) = operation.filter(|_| first) {
            tape.register::<B>(operation.id, gradient);
        }
    }
}

/// [`recorded`] for an operation with several outputs. Burn's tape has one output for each operation, so columns of a common one would
/// be copies, and their gradients would be put among zeros and added up: on a GPU each is a launch.
fn recorded_outputs<
    B: Backend,
    C: CheckpointStrategy,
    S: Clone + Debug + Send + 'static,
    const K: usize,
    const N: usize,
>(
    parents: [NodeGuard; N],
    (outputs, saved): ([FloatTensor<B>; K], S),
    derivative: DerivativeOfAll<B, S, K, N>,
) -> [FloatTensor<Autodiff<B, C>>; K] {
    let gathered: Gathered<B, K> = Arc::new(Mutex::new(std::array::from_fn(|_| None)));
    let state = (saved, gathered.clone(), derivative);
    let operation = recorded::<B, C, _, N>(parents, (outputs[0].clone(), state), |(saved, gathered, derivative), _| {
        let mut gathered = gathered.lock().unwrap_or_else(PoisonError::into_inner);
        derivative(saved, gathered.each_mut().map(Option::take))
    });
    let mut places = 0..K;
    outputs.map(|output| {
        let state = (gathered.clone(), places.next().expect("a place for each output"));
        match Backward::<B, 1>::prepare::<C>(Gathering::<K>, [operation.node()]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(state, output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    })
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

#[cfg(all(test, feature = "wgpu"))]
mod tests {
    use std::collections::HashSet;

    use burn::tensor::Device;

    use super::*;

    #[test]
    fn every_shader_is_in_the_list_of_kernels_and_no_kernel_twice() {
        let all = kernels();
        for shader in light4gs_shaders::ALL {
            assert!(all.iter().any(|kernel| kernel.name() == shader.name), "{}", shader.name);
        }
        let names: HashSet<String> = all.iter().map(Kernel::to_string).collect();
        assert_eq!(names.len(), all.len());
    }

    /// Within a share of the largest number: each operation has closer tests of its own.
    #[test]
    #[cfg(feature = "flex")]
    fn a_gpu_computes_what_a_cpu_does() {
        const SHARE: f32 = 1e-4;
        let devices = [Device::flex(), Device::wgpu(Default::default())];
        for operation in ON_GPU {
            for (sample, call) in operation.samples.iter().enumerate() {
                let [expected, found] = devices.each_ref().map(call);
                assert_eq!(expected.len(), found.len(), "{}", operation.name);
                for (k, (expected, found)) in expected.iter().zip(&found).enumerate() {
                    let largest = expected.iter::<f32>().fold(0.0, |largest: f32, value| largest.max(value.abs()));
                    let pairs = expected.iter::<f32>().zip(found.iter::<f32>());
                    let error = pairs.map(|(expected, found)| (expected - found).abs()).fold(0.0, f32::max);
                    let case = format!("{}, sample {sample}, tensor {k}", operation.name);
                    assert!(largest > 0.0 && error <= SHARE * largest, "{case}: {error} of {largest}");
                }
            }
        }
    }
}
