//! A device, its limits, and the conversion between Burn's tensors and plain buffers.

use burn::tensor::{DType, Shape};
use burn_wgpu::CubeTensor;
use burn_wgpu::into_contiguous;
use cubecl::Device as CubeDevice;
use cubecl::client::Client;
use cubecl::server::Handle;

use crate::gpu_error::{GpuError, first_lines};
use crate::read_backs::ReadBacks;

/// Tensors within a buffer begin at multiples of this many values, where every adapter can bind them.
pub(crate) const PLACE_ALIGNMENT: usize = 64;

/// A wgpu device.
pub(crate) struct Gpu {
    pub(crate) client: Client,
    device: CubeDevice,
}

impl Gpu {
    /// The device of a tensor.
    pub(crate) fn of(tensor: &CubeTensor) -> Result<Self, GpuError> {
        let runtime = tensor.client.name();
        if runtime != "wgpu<wgsl>" {
            return Err(GpuError::Runtime(runtime.to_owned()));
        }
        Ok(Self { client: tensor.client.clone(), device: tensor.device.clone() })
    }

    /// Iterations that a loop may have. Mesa's software driver ends any loop after 65535, without an error.
    pub(crate) fn longest_loop(&self) -> usize {
        if self.is_mesas_software() { 60_000 } else { u32::MAX as usize }
    }

    /// Splats of a cell's list that one launch blends. Elsewhere than on Mesa's software driver ([`Gpu::longest_loop`]), a graphics
    /// driver may stop a launch that runs for seconds. There each splat is a round, and each fetch of eight is two, of the loop
    /// over the fetches and of the last, empty round over their members: so at most 4/5 of 65535.
    pub(crate) fn longest_list(&self) -> usize {
        if self.is_mesas_software() { 52_000 } else { 1 << 20 }
    }

    /// Whether this is Mesa's software driver.
    pub(crate) fn is_mesas_software(&self) -> bool {
        self.client.properties().identity.physical.is_none()
    }

    /// A buffer for `count` values of four bytes, at least one.
    pub(crate) fn allocate(&self, buffer: &'static str, count: usize) -> Result<Handle, GpuError> {
        let bytes = 4 * count.max(PLACE_ALIGNMENT) as u64;
        if !self.holds(count) {
            return Err(GpuError::TooLarge { buffer, bytes, limit: self.largest_buffer() });
        }
        Ok(self.client.empty(bytes as usize))
    }

    /// Whether a buffer may have `count` values of four bytes.
    pub(crate) fn holds(&self, count: usize) -> bool {
        count as u64 <= self.largest_buffer() / 4
    }

    /// Bytes.
    fn largest_buffer(&self) -> u64 {
        self.client.properties().memory.max_page_size
    }

    /// A float32 tensor over a buffer or a piece of it.
    pub(crate) fn tensor(&self, handle: Handle, shape: Shape) -> CubeTensor {
        CubeTensor::new_contiguous(self.client.clone(), self.device.clone(), shape, handle, DType::F32)
    }

    /// An int32 tensor over a buffer.
    pub(crate) fn int_tensor(&self, handle: Handle, shape: Shape) -> CubeTensor {
        CubeTensor::new_contiguous(self.client.clone(), self.device.clone(), shape, handle, DType::I32)
    }

    /// Reads one word, waiting for everything that was launched before.
    pub(crate) fn read_word(&self, operation: &'static str, buffer: &Handle) -> Result<u32, GpuError> {
        let bytes = self.client.read_one(first_words(buffer, 1)).map_err(|error| failed(operation, &error))?;
        ReadBacks::count(4);
        Ok(u32::from_le_bytes(bytes[..4].try_into().expect("a word has four bytes")))
    }

    /// An error if anything that was launched so far, and that these buffers depend on, has failed.
    pub(crate) fn check(&self, operation: &'static str, buffers: &[&Handle]) -> Result<(), GpuError> {
        self.client.check(buffers.iter().copied()).map_err(|error| failed(operation, &error))
    }
}

fn failed(operation: &'static str, error: &impl std::fmt::Display) -> GpuError {
    GpuError::Device { operation, reason: first_lines(&error.to_string()) }
}

/// A tensor's values in row-major order. An empty tensor becomes a buffer that can be bound but holds nothing.
pub(crate) fn buffer_of(tensor: CubeTensor) -> Handle {
    assert_eq!(tensor.dtype, DType::F32, "the custom operations take float32 tensors");
    if tensor.meta.shape().num_elements() == 0 {
        return tensor.client.empty(4 * PLACE_ALIGNMENT);
    }
    into_contiguous(tensor).handle
}

/// The first `count` words of a buffer, which may be larger.
pub(crate) fn first_words(buffer: &Handle, count: usize) -> Handle {
    let unused = buffer.size_in_used() - 4 * count as u64;
    buffer.clone().offset_end(unused)
}

/// Some words of a buffer. Where they begin must be a multiple of [`PLACE_ALIGNMENT`].
pub(crate) fn words(buffer: &Handle, start: usize, count: usize) -> Handle {
    let (start, end) = (4 * start as u64, 4 * (start + count) as u64);
    buffer.clone().offset_start(start).offset_end(buffer.size_in_used() - end)
}

/// Several arrays in one buffer, each beginning where it can be bound.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    pub(crate) starts: Vec<usize>,
    lengths: Vec<usize>,
    pub(crate) total: usize,
}

impl Places {
    /// Values that an array of this length takes, with the gap behind it.
    pub(crate) fn room_of(length: usize) -> usize {
        length.next_multiple_of(PLACE_ALIGNMENT).max(PLACE_ALIGNMENT)
    }

    pub(crate) fn new(lengths: &[usize]) -> Self {
        let mut total = 0;
        let starts = lengths
            .iter()
            .map(|length| {
                let start = total;
                total += Self::room_of(*length);
                start
            })
            .collect();
        Self { starts, lengths: lengths.to_vec(), total }
    }

    /// Array `k` of the buffer that holds them all. An empty one is a place that can be bound.
    pub(crate) fn of(&self, buffer: &Handle, k: usize) -> Handle {
        let length = self.lengths[k];
        words(buffer, self.starts[k], if length == 0 { PLACE_ALIGNMENT } else { length })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use cubecl::client::Client;

    use cubecl::wgpu::WgpuDevice;

    use super::*;

    /// The default adapter, without Burn.
    pub(crate) fn default_gpu() -> Gpu {
        let device = WgpuDevice::default();
        let client: Client = CubeDevice::Wgpu(device.clone()).client();
        Gpu { client, device: CubeDevice::Wgpu(device) }
    }
}
