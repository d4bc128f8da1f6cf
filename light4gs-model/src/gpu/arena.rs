//! Tensors in one buffer, so that one launch can take any number of them.

use cubecl::server::Handle;
use light4gs_shaders::PACK_TENSORS;

use super::context::{Gpu, Places};
use super::kernel::Kernel;
use super::launch::{Launch, same_memory};
use crate::gpu_error::GpuError;

/// Tensors that one launch of `pack_tensors` takes.
const PACKED: usize = 7;

/// The kernel of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    vec![PACK_TENSORS.into()]
}

/// Tensors in one buffer, each at its place.
#[derive(Clone, Debug)]
pub(crate) struct Arena {
    pub(crate) buffer: Handle,
    pub(crate) places: Places,
}

impl Arena {
    /// An arena for tensors of these lengths. Its contents are undefined.
    pub(crate) fn new(gpu: &Gpu, name: &'static str, lengths: &[usize]) -> Result<Self, GpuError> {
        let places = Places::new(lengths);
        Ok(Self { buffer: gpu.allocate(name, places.total)?, places })
    }

    /// The tensors of these lengths, as they are if they lie in one arena already, otherwise copied to a new one.
    pub(crate) fn of(gpu: &Gpu, name: &'static str, tensors: &[Handle], lengths: &[usize]) -> Result<Self, GpuError> {
        let places = Places::new(lengths);
        if let Some(buffer) = common_buffer(tensors, &places) {
            return Ok(Self { buffer, places });
        }
        let arena = Self::new(gpu, name, lengths)?;
        for first in (0..tensors.len()).step_by(PACKED) {
            let end = tensors.len().min(first + PACKED);
            let longest = lengths[first..end].iter().copied().max().unwrap_or(0);
            let mut uniform = vec![longest as u32, 0, 0, 0];
            let mut launch = Launch::new(&gpu.client, PACK_TENSORS);
            for tensor in first..first + PACKED {
                // What is not there is bound as well.
                if tensor < end {
                    uniform.extend([lengths[tensor] as u32, arena.places.starts[tensor] as u32, 0, 0]);
                    launch = launch.reads(&tensors[tensor]);
                } else {
                    uniform.extend([0; 4]);
                    launch = launch.reads(&gpu.allocate("no tensor", 1)?);
                }
            }
            launch.updates_if(first > 0, &arena.buffer).uniform(&uniform).invocations(PACKED * longest)?;
        }
        Ok(arena)
    }

    /// Tensor `k`.
    pub(crate) fn tensor(&self, k: usize) -> Handle {
        self.places.of(&self.buffer, k)
    }
}

/// The piece of a buffer in which all tensors lie at their places.
fn common_buffer(tensors: &[Handle], places: &Places) -> Option<Handle> {
    let start = |handle: &Handle| handle.offset_start.unwrap_or(0);
    let first = tensors.first()?;
    let lies = |(tensor, place): (&Handle, &usize)| {
        same_memory(first, tensor) && start(tensor) == start(first) + 4 * *place as u64
    };
    let rest = first.size().checked_sub(start(first) + 4 * places.total as u64)?;
    let mut whole = first.clone();
    whole.offset_end = Some(rest);
    tensors.iter().zip(&places.starts).all(lies).then_some(whole)
}

#[cfg(test)]
mod tests {
    use cubecl::server::Handle;

    use super::super::context::tests::default_gpu;
    use super::*;

    fn upload(gpu: &Gpu, values: &[f32]) -> Handle {
        gpu.client.create_from_slice(&values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
    }

    fn download(gpu: &Gpu, handle: Handle) -> Vec<f32> {
        let bytes = gpu.client.read_one(handle).expect("a readable buffer");
        bytes.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect()
    }

    #[test]
    fn tensors_are_copied_once_and_then_lie_where_they_are() {
        let gpu = default_gpu();
        // More than one launch takes, of very different lengths.
        let values: Vec<Vec<f32>> = (1..=9).map(|k| (0..k * k * k).map(|i| (100 * k + i) as f32).collect()).collect();
        let lengths: Vec<usize> = values.iter().map(Vec::len).collect();
        let tensors: Vec<Handle> = values.iter().map(|values| upload(&gpu, values)).collect();
        let arena = Arena::of(&gpu, "a test", &tensors, &lengths).unwrap();
        let views: Vec<Handle> = (0..values.len()).map(|k| arena.tensor(k)).collect();
        for (view, values) in views.iter().zip(&values) {
            assert_eq!(download(&gpu, view.clone()), *values);
        }
        assert!(common_buffer(&tensors, &arena.places).is_none());
        let again = Arena::of(&gpu, "a test", &views, &lengths).unwrap();
        assert!(same_memory(&again.buffer, &arena.buffer));
        // Some of them lie in an arena as well, in another order they do not.
        let some = Arena::of(&gpu, "a test", &views[3..6], &lengths[3..6]).unwrap();
        assert!(same_memory(&some.buffer, &arena.buffer));
        assert_eq!(download(&gpu, some.tensor(1)), values[4]);
        let turned = [views[4].clone(), views[3].clone()];
        let copied = Arena::of(&gpu, "a test", &turned, &[lengths[4], lengths[3]]).unwrap();
        assert!(!same_memory(&copied.buffer, &arena.buffer));
        assert_eq!(download(&gpu, copied.tensor(0)), values[4]);
    }
}
