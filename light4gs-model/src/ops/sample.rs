//! Calls of operations on numbers that look random, for checks of compilers, adapters and back ends.

use burn::tensor::{Device, Tensor, TensorData};

/// An operation that has kernels on a GPU, for checks.
#[derive(Clone, Copy, Debug)]
pub struct GpuOperation {
    /// The name of its folder, here and in `shaders/`.
    pub name: &'static str,
    /// Each of its kernels with all constants that it can have.
    pub kernels: fn() -> Vec<super::Kernel>,
    /// Calls of the operation on a device, forward and backward, which together launch each of its shaders; they return outputs and
    /// gradients. None where the golden scenes of `tests/` launch them all.
    pub samples: &'static [fn(&Device) -> Vec<TensorData>],
}

/// A source of tensors, the same on every device.
pub(super) struct Numbers {
    device: Device,
    state: u32,
}

impl Numbers {
    pub(super) fn new(device: &Device) -> Self {
        Self { device: device.clone(), state: 1 }
    }

    /// `[rows, columns]`, uniform between `low` and `high`.
    pub(super) fn matrix(&mut self, rows: usize, columns: usize, low: f32, high: f32) -> Tensor<2> {
        let mut next = || {
            // The constants of Numerical Recipes' generator.
            self.state = self.state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            low + (high - low) * (self.state >> 8) as f32 / (1 << 24) as f32
        };
        let values = (0..rows * columns).map(|_| next()).collect();
        Tensor::from_data(TensorData::new::<f32, _>(values, [rows, columns]), &self.device)
    }

    /// A matrix that gets a gradient; the device must have autodiff.
    pub(super) fn leaf(&mut self, rows: usize, columns: usize, low: f32, high: f32) -> Tensor<2> {
        self.matrix(rows, columns, low, high).require_grad()
    }

    /// The output, and the gradients of the leaves from one of the output between -1 and 1.
    pub(super) fn with_gradients<const D: usize>(
        &mut self,
        output: Tensor<D>,
        leaves: &[Tensor<2>],
    ) -> Vec<TensorData> {
        let upstream = self.matrix(1, output.shape().num_elements(), -1.0, 1.0).reshape(output.dims());
        let gradients = (output.clone() * upstream).sum().backward();
        let of_leaves = leaves.iter().filter_map(|leaf| leaf.grad(&gradients)).map(|gradient| gradient.into_data());
        std::iter::once(output.into_data()).chain(of_leaves).collect()
    }
}
