//! Values on and below autodiff's tape.

use burn::tensor::Tensor;

/// The same values as constants of later operations.
pub(crate) fn untracked<const D: usize>(values: Tensor<D>) -> Tensor<D> {
    if values.device().is_autodiff() { values.set_require_grad(false) } else { values }
}

/// The same values on the back end below autodiff.
pub(crate) fn off_tape<const D: usize>(values: Tensor<D>) -> Tensor<D> {
    if values.device().is_autodiff() { values.inner() } else { values }
}
