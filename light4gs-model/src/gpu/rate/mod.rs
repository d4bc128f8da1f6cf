//! Operations of the attributes' rate on a GPU.

mod gather_rows;
mod mixture_bits;

use super::kernel::Kernel;

/// The kernels of this folder.
pub(super) fn kernels() -> Vec<Kernel> {
    [gather_rows::kernels(), mixture_bits::kernels()].concat()
}
