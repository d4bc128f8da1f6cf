//! Tensors in one buffer, so that one launch can take any number of them.

use std::ops::Range;

use cubecl::server::Handle;
use light4gs_shaders::PACK_TENSORS;

use super::context::{Gpu, Places};
use super::kernel::Kernel;
use super::launch::{Launch, same_memory};
use crate::gpu_error::GpuError;

/// Buffers that one launch of `pack_tensors` reads. So a sum never has more parts.
pub(crate) const PACKED_BUFFERS: usize = 7;
/// Sums that it makes, and their parts.
const MOST_SUMS: usize = 64;
const MOST_PARTS: usize = 128;

/// The kernel of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    vec![packing()]
}

fn packing() -> Kernel {
    Kernel::new(PACK_TENSORS).constant("MOST_SUMS", MOST_SUMS as u32).constant("MOST_PARTS", MOST_PARTS as u32)
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
        let parts: Vec<&[Handle]> = tensors.chunks(1).collect();
        Self::of_sums(gpu, name, &parts, lengths)
    }

    /// The sums of tensors of these lengths, [`PACKED_BUFFERS`] and fewer in each sum, added up in their order.
    pub(crate) fn of_sums(
        gpu: &Gpu,
        name: &'static str,
        sums: &[&[Handle]],
        lengths: &[usize],
    ) -> Result<Self, GpuError> {
        let arena = Self::new(gpu, name, lengths)?;
        let mut next = 0;
        while next < sums.len() {
            let first = next;
            let mut packing = Packing::default();
            while next < sums.len() && packing.add(sums[next], [arena.places.starts[next], lengths[next]]) {
                next += 1;
            }
            assert!(next > first, "no more than {PACKED_BUFFERS} tensors are added up at once");
            packing.launch(gpu, &arena.buffer, first > 0)?;
        }
        Ok(arena)
    }

    /// Tensor `k`.
    pub(crate) fn tensor(&self, k: usize) -> Handle {
        self.places.of(&self.buffer, k)
    }
}

/// What one launch of `pack_tensors` does.
#[derive(Default)]
struct Packing {
    /// In which the tensors lie.
    buffers: Vec<Handle>,
    /// Of each sum: where it begins, its length, its first part, its number of parts.
    places: Vec<[usize; 4]>,
    /// Of each part: its buffer, and where it begins there.
    parts: Vec<[usize; 2]>,
}

impl Packing {
    /// Adds a sum, which begins in the arena at `start`, unless there is no room for it.
    fn add(&mut self, tensors: &[Handle], [start, length]: [usize; 2]) -> bool {
        let buffers = self.buffers.len();
        let parts: Vec<[usize; 2]> = tensors.iter().map(|tensor| self.place_of(tensor)).collect();
        let fits = self.buffers.len() <= PACKED_BUFFERS
            && self.places.len() < MOST_SUMS
            && self.parts.len() + parts.len() <= MOST_PARTS;
        if !fits {
            self.buffers.truncate(buffers);
            return false;
        }
        self.places.push([start, length, self.parts.len(), parts.len()]);
        self.parts.extend(parts);
        true
    }

    /// The buffer of a tensor, whose whole memory is bound, and where it begins there.
    fn place_of(&mut self, tensor: &Handle) -> [usize; 2] {
        let buffer = self.buffers.iter().position(|buffer| same_memory(buffer, tensor)).unwrap_or_else(|| {
            let mut whole = tensor.clone();
            (whole.offset_start, whole.offset_end) = (None, None);
            self.buffers.push(whole);
            self.buffers.len() - 1
        });
        [buffer, tensor.offset_start.unwrap_or(0) as usize / 4]
    }

    /// `later`: some numbers of the arena are there already.
    fn launch(&self, gpu: &Gpu, arena: &Handle, later: bool) -> Result<(), GpuError> {
        let Self { buffers, places, parts } = self;
        let [first, _, ..] = places[0];
        let total = places.last().map_or(0, |[start, length, ..]| start + length - first);
        let row = |numbers: &[usize], rows: usize| {
            let mut words: Vec<u32> = numbers.iter().map(|number| *number as u32).collect();
            words.resize(4 * rows, 0);
            words
        };
        let parts: Vec<usize> = parts.iter().flat_map(|[buffer, start]| [*buffer, *start, 0, 0]).collect();
        let uniform =
            [row(&[places.len(), first, total], 1), row(places.as_flattened(), MOST_SUMS), row(&parts, MOST_PARTS)];
        let mut launch = Launch::new(&gpu.client, packing());
        for buffer in buffers {
            launch = launch.reads(buffer);
        }
        // What is not there is bound as well.
        for _ in buffers.len()..PACKED_BUFFERS {
            launch = launch.reads(&gpu.allocate("no tensor", 1)?);
        }
        launch.updates_if(later, arena).uniform(&uniform.concat()).invocations(total)
    }
}

/// Tensors of these lengths in batches, each of as many as one buffer holds and no more than `most`, but of one at least.
pub(crate) fn batches(gpu: &Gpu, lengths: &[usize], most: usize) -> Vec<Range<usize>> {
    let (mut batches, mut first, mut total): (Vec<Range<usize>>, usize, usize) = (Vec::new(), 0, 0);
    for (tensor, length) in lengths.iter().enumerate() {
        let room = Places::room_of(*length);
        if tensor > first && (tensor - first == most || !gpu.holds(total + room)) {
            batches.push(first..tensor);
            (first, total) = (tensor, 0);
        }
        total += room;
    }
    if first < lengths.len() {
        batches.push(first..lengths.len());
    }
    batches
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

    #[test]
    fn batches_have_every_tensor_once() {
        let gpu = default_gpu();
        assert!(batches(&gpu, &[], 2).is_empty());
        assert_eq!(batches(&gpu, &[1, 0, 5], usize::MAX).first(), Some(&(0..3)));
        assert_eq!(batches(&gpu, &[9; 5], 2), [0..2, 2..4, 4..5]);
        // What no buffer holds is alone, and fails later.
        assert_eq!(batches(&gpu, &[1, 1 << 50, 1, 1], 64), [0..1, 1..2, 2..4]);
    }

    #[test]
    fn sums_are_made_while_tensors_are_copied() {
        let gpu = default_gpu();
        // Four sums of three tensors each: two launches.
        let lengths = [5, 700, 1, 64];
        let part = |sum: usize, part: usize| -> Vec<f32> {
            (0..lengths[sum]).map(|i| (1000 * sum + 100 * part + i) as f32).collect()
        };
        let parts: Vec<Vec<Handle>> = (0..4).map(|sum| [0, 1, 2].map(|k| upload(&gpu, &part(sum, k))).into()).collect();
        let parts: Vec<&[Handle]> = parts.iter().map(Vec::as_slice).collect();
        let arena = Arena::of_sums(&gpu, "a test", &parts, &lengths).unwrap();
        for (sum, length) in lengths.iter().enumerate() {
            let expected: Vec<f32> = (0..*length).map(|i| (3000 * sum + 300 + 3 * i) as f32).collect();
            assert_eq!(download(&gpu, arena.tensor(sum)), expected);
        }
    }
}
