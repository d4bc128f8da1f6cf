//! Operations of the attributes' rate on a GPU.

mod mixture_bits;
mod neighborhoods;

use super::kernel::Kernel;

/// The kernels of this folder.
pub(super) fn kernels() -> Vec<Kernel> {
    [mixture_bits::kernels(), neighborhoods::kernels()].concat()
}
