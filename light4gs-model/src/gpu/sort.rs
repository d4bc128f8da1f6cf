//! Prefix sums, a stable radix sort, and ranges of equal keys.

use cubecl::server::Handle;
use light4gs_shaders::{PREFIX_SUM, RADIX_COUNT, RADIX_SCATTER, RANGES, Shader};

use super::context::{Gpu, PLACE_ALIGNMENT, words};
use super::kernel::Kernel;
use super::launch::Launch;
use crate::gpu_error::GpuError;

/// Values of one workgroup of the prefix sum.
const SUM_BLOCK: usize = 2048;
/// Values up to which one workgroup is as fast as three launches.
const SUM_ALONE: usize = 8 * SUM_BLOCK;
/// Most workgroups that each add up the sums of those before it.
const SUMS_ALONE: usize = 1024;
/// Keys of one workgroup of the sort.
const SORT_BLOCK: usize = 1024;
/// Invocations of such a workgroup, each with a counter for every digit: 16 KiB of workgroup memory.
const SORT_GROUP: u32 = 32;
const RADIX_BITS: u32 = 7;
/// Most blocks that each add up the entries that they need of a pass's table. With more blocks that would be too many
/// reads, so prefix sums replace the table first.
const BLOCKS_ALONE: usize = 256;
/// Passes over the widest keys.
const MOST_PASSES: u32 = u32::BITS.div_ceil(RADIX_BITS);

/// The kernels of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    let flags = [false, true];
    let sums = (0..4).map(summing);
    let scattering = flags.into_iter().flat_map(move |summed| {
        flags.into_iter().flat_map(move |first| flags.map(|last| Scattering { summed, first, last }.kernel()))
    });
    sums.chain((1..=MOST_PASSES).map(counting)).chain(scattering).chain([RANGES.into()]).collect()
}

/// A step of the prefix sum; 1 takes a single workgroup.
fn summing(step: u32) -> Kernel {
    Kernel::new(PREFIX_SUM).constant("STEP", step).constant("BLOCK", SUM_BLOCK as u32)
}

fn by_digit(shader: Shader) -> Kernel {
    let kernel = Kernel::new(shader).workgroup(SORT_GROUP);
    kernel.constant("BLOCK", SORT_BLOCK as u32).constant("RADIX_BITS", RADIX_BITS)
}

fn counting(passes: u32) -> Kernel {
    by_digit(RADIX_COUNT).constant("PASSES", passes)
}

/// Variants of a pass of the sort.
struct Scattering {
    /// Its table has been replaced by prefix sums.
    summed: bool,
    first: bool,
    last: bool,
}

impl Scattering {
    fn kernel(&self) -> Kernel {
        by_digit(RADIX_SCATTER)
            .constant("SUMMED", self.summed.into())
            .constant("FIRST", self.first.into())
            .constant("LAST", self.last.into())
    }
}

/// Replaces `count` words by their exclusive prefix sums. Returns a buffer that holds the total.
pub(crate) fn prefix_sum(gpu: &Gpu, values: &Handle, count: usize) -> Result<Handle, GpuError> {
    let blocks = count.div_ceil(SUM_BLOCK);
    // Behind the sums of the blocks, where it can be bound.
    let total_at = blocks.next_multiple_of(PLACE_ALIGNMENT);
    let step = |step: u32, values: &Handle, sums: &Handle, count: usize| {
        let launch = Launch::new(&gpu.client, summing(step)).updates(values).updates(sums);
        let groups = if step == 1 { 1 } else { count.div_ceil(SUM_BLOCK) };
        launch.uniform(&[count as u32, total_at as u32]).groups(groups)
    };
    let total = gpu.allocate("total of a prefix sum", 1)?;
    if count <= SUM_ALONE {
        step(1, values, &total, count)?;
        return Ok(total);
    }
    let sums = gpu.allocate("sums of blocks", total_at + 1)?;
    step(0, values, &sums, count)?;
    if blocks <= SUMS_ALONE {
        step(3, values, &sums, count)?;
        return Ok(words(&sums, total_at, 1));
    }
    step(1, &sums, &total, blocks)?;
    step(2, values, &sums, count)?;
    Ok(total)
}

/// Keys in ascending order, and the index of each before the sort.
#[derive(Clone)]
pub(crate) struct Sorted {
    pub(crate) keys: Handle,
    pub(crate) order: Handle,
}

/// Sorts `count` keys of which only the lowest `bits` bits differ. Equal keys keep their order.
pub(crate) fn sort(gpu: &Gpu, keys: &Handle, count: usize, bits: u32) -> Result<Sorted, GpuError> {
    let blocks = count.div_ceil(SORT_BLOCK).max(1);
    let passes = bits.div_ceil(RADIX_BITS).max(1);
    // A table for each pass, all of the same length, so that they can be bound one by one.
    let table_length = blocks << RADIX_BITS;
    let tables = gpu.allocate("digits of a sort", passes as usize * table_length)?;
    Launch::new(&gpu.client, counting(passes))
        .reads(keys)
        .writes(&tables)
        .uniform(&[count as u32, blocks as u32])
        .groups(blocks)?;
    // The passes alternate between two buffers.
    let buffers = (0..passes.min(2))
        .map(|_| Ok(Sorted { keys: gpu.allocate("sorted keys", count)?, order: gpu.allocate("sorted order", count)? }))
        .collect::<Result<Vec<_>, GpuError>>()?;
    // The first pass reads no order: the index of a key is its place.
    let no_order = gpu.allocate("no order", 0)?;
    let summed = blocks > BLOCKS_ALONE;
    for pass in 0..passes as usize {
        let (from_keys, from_order) = match pass {
            0 => (keys, &no_order),
            _ => (&buffers[(pass - 1) % 2].keys, &buffers[(pass - 1) % 2].order),
        };
        let to = &buffers[pass % 2];
        if summed {
            prefix_sum(gpu, &words(&tables, pass * table_length, table_length), table_length)?;
        }
        let scattering = Scattering { summed, first: pass == 0, last: pass + 1 == passes as usize };
        Launch::new(&gpu.client, scattering.kernel())
            .reads(from_keys)
            .reads(from_order)
            .updates(&tables)
            .writes(&to.keys)
            .writes(&to.order)
            .uniform(&[count as u32, blocks as u32, pass as u32])
            .groups(blocks)?;
    }
    Ok(buffers[(passes as usize - 1) % 2].clone())
}

/// `[groups + 1]`: where each group's keys begin among sorted ones. The last entry is where keys of `groups` and above
/// begin.
pub(crate) fn ranges(gpu: &Gpu, keys: &Handle, count: usize, groups: usize) -> Result<Handle, GpuError> {
    let starts = gpu.allocate("starts of ranges", groups + 1)?;
    Launch::new(&gpu.client, RANGES)
        .reads(keys)
        .writes(&starts)
        .uniform(&[count as u32, groups as u32])
        .invocations(groups + 1)?;
    Ok(starts)
}

/// The number of bits that can hold every number up to `largest`.
pub(crate) fn bits_for(largest: usize) -> u32 {
    usize::BITS - largest.leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::super::context::tests::default_gpu;
    use super::*;

    fn upload(gpu: &Gpu, words: &[u32]) -> Handle {
        let mut words = words.to_vec();
        words.resize(words.len().max(1), 0);
        gpu.client.create_from_slice(&words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>())
    }

    fn read(gpu: &Gpu, handle: &Handle, count: usize) -> Vec<u32> {
        let bytes = gpu.client.read_one(handle.clone()).unwrap();
        bytes.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).take(count).collect()
    }

    /// By one workgroup, by two launches, by three.
    #[test]
    fn prefix_sums_of_few_and_many_values() {
        let gpu = default_gpu();
        for count in [1, SUM_ALONE, SUM_ALONE + 1, 5 * SUM_ALONE, SUMS_ALONE * SUM_BLOCK + 1] {
            let values: Vec<u32> = (0..count as u32).map(|i| i * 7 % 5).collect();
            let handle = upload(&gpu, &values);
            let total = prefix_sum(&gpu, &handle, count).unwrap();
            let mut sum = 0;
            let mut expected = values.iter().map(|value| {
                sum += value;
                sum - value
            });
            assert!(read(&gpu, &handle, count).into_iter().eq(expected.by_ref()), "{count} values");
            assert_eq!(read(&gpu, &total, 1), [sum], "{count} values");
        }
    }

    /// Few blocks and many, one pass and several, keys that are equal.
    #[test]
    fn keys_are_sorted_and_equal_ones_keep_their_order() {
        let gpu = default_gpu();
        let mut state = 1u32;
        for (count, bits) in [(0, 7), (1, 28), (1000, 7), (5000, 10), (70_001, 28), (300_000, 10)] {
            let keys: Vec<u32> = (0..count)
                .map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    // Only some of the keys' values occur, so that many are equal.
                    (state >> 8) * 37 % 3001 % (1 << bits)
                })
                .collect();
            let mut order: Vec<u32> = (0..count as u32).collect();
            order.sort_by_key(|&index| keys[index as usize]);
            let sorted = sort(&gpu, &upload(&gpu, &keys), count, bits).unwrap();
            let case = format!("{count} keys of {bits} bits");
            assert!(read(&gpu, &sorted.order, count) == order, "order of {case}");
            let expected: Vec<u32> = order.iter().map(|&index| keys[index as usize]).collect();
            assert!(read(&gpu, &sorted.keys, count) == expected, "{case}");
        }
    }
}
