//! What only training launches: the loss of an image, and the optimizer's step.

mod adam;
mod image_difference;

use super::{context, kernel, launch};

pub(crate) use adam::adam_on_gpu;

/// The kernels of this folder.
pub(super) fn kernels() -> Vec<kernel::Kernel> {
    [adam::kernels, image_difference::kernels].into_iter().flat_map(|kernels| kernels()).collect()
}
