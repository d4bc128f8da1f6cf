//! Prefix sums, a stable radix sort, and ranges of equal keys.

use cubecl::server::Handle;
use light4gs_shaders::{PREFIX_SUM, RADIX_COUNT, RADIX_SCATTER, RANGES, Shader};

use super::context::Gpu;
use super::kernel::Kernel;
use super::launch::Launch;
use crate::gpu_error::GpuError;

/// Values of one workgroup of the prefix sum.
const SUM_BLOCK: usize = 2048;
/// Up to this many values, one workgroup is as fast as three launches.
const SUM_ALONE: usize = 8 * SUM_BLOCK;
/// Keys of one workgroup of the sort.
const SORT_BLOCK: usize = 1024;
/// Invocations of such a workgroup, each with a counter for every digit: 16 KiB of workgroup memory.
const SORT_GROUP: u32 = 32;
const RADIX_BITS: u32 = 7;

/// The kernels of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    let sums = (0..3).map(summing);
    let scattering = [true, false].map(scattering);
    sums.chain([by_digit(RADIX_COUNT)]).chain(scattering).chain([RANGES.into()]).collect()
}

/// A step of the prefix sum; 1 takes a single workgroup.
fn summing(step: u32) -> Kernel {
    Kernel::new(PREFIX_SUM).constant("STEP", step).constant("BLOCK", SUM_BLOCK as u32)
}

fn by_digit(shader: Shader) -> Kernel {
    let kernel = Kernel::new(shader).workgroup(SORT_GROUP);
    kernel.constant("BLOCK", SORT_BLOCK as u32).constant("RADIX_BITS", RADIX_BITS)
}

fn scattering(first: bool) -> Kernel {
    by_digit(RADIX_SCATTER).constant("FIRST", u32::from(first))
}

/// Replaces `count` words by their exclusive prefix sums. Returns a buffer that holds the total.
pub(super) fn prefix_sum(gpu: &Gpu, values: &Handle, count: usize) -> Result<Handle, GpuError> {
    let step = |step: u32, values: &Handle, sums: &Handle, count: usize| {
        let launch = Launch::new(&gpu.client, summing(step)).updates(values).updates(sums).uniform(&[count as u32]);
        launch.groups(if step == 1 { 1 } else { count.div_ceil(SUM_BLOCK) })
    };
    let total = gpu.allocate("total of a prefix sum", 1)?;
    if count <= SUM_ALONE {
        step(1, values, &total, count)?;
        return Ok(total);
    }
    let blocks = count.div_ceil(SUM_BLOCK);
    let sums = gpu.allocate("sums of blocks", blocks)?;
    step(0, values, &sums, count)?;
    step(1, &sums, &total, blocks)?;
    step(2, values, &sums, count)?;
    Ok(total)
}

/// Keys in ascending order, and the index that each had before.
#[derive(Clone)]
pub(super) struct Sorted {
    pub(super) keys: Handle,
    pub(super) order: Handle,
}

/// Sorts `count` keys of which only the lowest `bits` bits differ. Equal keys keep their order.
pub(super) fn sort(gpu: &Gpu, keys: &Handle, count: usize, bits: u32) -> Result<Sorted, GpuError> {
    let blocks = count.div_ceil(SORT_BLOCK).max(1);
    let digits = 1usize << RADIX_BITS;
    let table = gpu.allocate("digits of a sort", digits * blocks)?;
    let passes = bits.div_ceil(RADIX_BITS).max(1) as usize;
    // The passes alternate between two buffers.
    let buffers = (0..passes.min(2))
        .map(|_| Ok(Sorted { keys: gpu.allocate("sorted keys", count)?, order: gpu.allocate("sorted order", count)? }))
        .collect::<Result<Vec<_>, GpuError>>()?;
    // The first pass reads no order: the index of a key is its place.
    let no_order = gpu.allocate("no order", 0)?;
    for pass in 0..passes {
        let parameters = [count as u32, pass as u32 * RADIX_BITS, blocks as u32];
        let (from_keys, from_order) = match pass {
            0 => (keys, &no_order),
            _ => (&buffers[(pass - 1) % 2].keys, &buffers[(pass - 1) % 2].order),
        };
        let to = &buffers[pass % 2];
        Launch::new(&gpu.client, by_digit(RADIX_COUNT))
            .reads(from_keys)
            .writes(&table)
            .uniform(&parameters)
            .groups(blocks)?;
        prefix_sum(gpu, &table, digits * blocks)?;
        Launch::new(&gpu.client, scattering(pass == 0))
            .reads(from_keys)
            .reads(from_order)
            .reads(&table)
            .writes(&to.keys)
            .writes(&to.order)
            .uniform(&parameters)
            .groups(blocks)?;
    }
    Ok(buffers[(passes - 1) % 2].clone())
}

/// `[groups + 1]`: where each group's keys begin among sorted ones. The last entry is where keys of `groups` and above
/// begin.
pub(super) fn ranges(gpu: &Gpu, keys: &Handle, count: usize, groups: usize) -> Result<Handle, GpuError> {
    let starts = gpu.allocate("starts of ranges", groups + 1)?;
    Launch::new(&gpu.client, RANGES)
        .reads(keys)
        .writes(&starts)
        .uniform(&[count as u32, groups as u32])
        .invocations(groups + 1)?;
    Ok(starts)
}

/// The number of bits that can hold every number up to `largest`.
pub(super) fn bits_for(largest: usize) -> u32 {
    usize::BITS - largest.leading_zeros()
}
