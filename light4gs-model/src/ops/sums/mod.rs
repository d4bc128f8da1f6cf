//! Sums of tensors, as a Burn operation: gradients of parameters come in parts, and on a GPU one launch adds up those of several
//! parameters where Burn takes one for each addition. Not differentiable.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

use super::tensor_list::TensorList;

/// The sums on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait SumsOps: Backend {
    /// The sums of consecutive parts: `numbers` has how many each takes, at least one.
    fn sums(#[extension_type] parts: TensorList<Self>, numbers: Vec<usize>) -> TensorList<Self>;
}

/// The sum of each list of tensors, added up in their order.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::sums::sums;
///
/// let device = Device::flex();
/// let numbers = |a: f32, b: f32| Tensor::<1>::from_floats([a, b], &device);
/// let found = sums(vec![vec![numbers(1.0, 2.0), numbers(3.0, 4.0)], vec![numbers(5.0, 6.0)]]);
/// let found: Vec<Vec<f32>> = found.into_iter().map(|sum| sum.into_data().to_vec().unwrap()).collect();
/// assert_eq!(found, [[4.0, 6.0], [5.0, 6.0]]);
/// ```
///
/// # Panics
/// If a list is empty, or its tensors differ in length.
pub fn sums(lists: Vec<Vec<Tensor<1>>>) -> Vec<Tensor<1>> {
    for list in &lists {
        let lengths: Vec<usize> = list.iter().map(|part| part.dims()[0]).collect();
        assert!(
            !list.is_empty() && lengths.iter().all(|length| *length == lengths[0]),
            "no sum of {lengths:?} numbers"
        );
    }
    if lists.is_empty() {
        return Vec::new();
    }
    let numbers = lists.iter().map(Vec::len).collect();
    let parts = lists.into_iter().flatten().map(Tensor::into_dispatch).collect();
    Dispatch::sums(TensorList(parts), numbers).0.into_iter().map(Tensor::from_dispatch).collect()
}
