//! Custom operations in a fusion stream.
//!
//! Burn's `fusion` feature, one of its defaults, wraps the back end of a GPU in [`Fusion`]: operations are queued, and
//! successive ones are compiled into one kernel. Our kernels cannot be merged with others, and splatting has to read a
//! count back half-way. So our operations drain the queue, run on the tensors themselves, and put the results back into
//! the queue as new leaves. Errors then arise in the caller's thread, as without fusion.
//!
//! The implementations for `Fusion<B>` do not depend on this crate's own feature `fusion`: another crate of the same
//! program may have switched Burn's on.

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{DType, Shape};
use burn_fusion::custom::{CustomOpIr, OperationIr, StreamId, TensorIr};
use burn_fusion::{Fusion, FusionBackend, FusionTensor, NoOp, get_client};

use super::tensor_list::TensorList;

/// The tensor itself, after everything that it depends on has been launched.
pub(super) fn resolve<B: FusionBackend>(tensor: FloatTensor<Fusion<B>>) -> FloatTensor<B> {
    let client = tensor.client.clone();
    client.resolve_tensor_float::<B>(tensor)
}

/// The tensors of a list themselves.
pub(super) fn resolve_all<B: FusionBackend>(list: TensorList<Fusion<B>>) -> TensorList<B> {
    TensorList(list.0.into_iter().map(resolve::<B>).collect())
}

/// The tensors of a list as leaves of the stream.
pub(super) fn leaves<B: FusionBackend>(list: TensorList<B>) -> TensorList<Fusion<B>> {
    TensorList(list.0.into_iter().map(leaf::<B>).collect())
}

/// A float tensor as a leaf of the stream.
pub(super) fn leaf<B: FusionBackend>(tensor: FloatTensor<B>) -> FloatTensor<Fusion<B>> {
    let (device, shape, dtype) = (tensor.device(), tensor.shape(), tensor.dtype());
    register::<B>(&device, shape, dtype, B::float_tensor_handle(tensor))
}

/// An integer tensor as a leaf of the stream.
pub(super) fn int_leaf<B: FusionBackend>(tensor: IntTensor<B>) -> IntTensor<Fusion<B>> {
    let (device, shape, dtype) = (tensor.device(), tensor.shape(), tensor.dtype());
    register::<B>(&device, shape, dtype, B::int_tensor_handle(tensor))
}

fn register<B: FusionBackend>(
    device: &B::Device,
    shape: Shape,
    dtype: DType,
    handle: B::Handle,
) -> FusionTensor<B::FusionRuntime> {
    let client = get_client::<B>(device);
    let output = TensorIr::uninit(client.register_tensor_handle(handle), shape, dtype);
    let leaf = OperationIr::Custom(CustomOpIr::new("light4gs_result", &[], &[output]));
    let mut outputs = client.register(StreamId::current(), leaf, NoOp::<B>::new());
    outputs.pop().expect("the operation has one output")
}
