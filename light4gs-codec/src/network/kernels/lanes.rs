//! A linear layer at eight positions at a time.

/// Positions that are computed together.
pub(crate) const LANES: usize = 8;
/// One channel at [`LANES`] positions.
pub(crate) type Lanes = [f32; LANES];
/// Outputs that are computed together.
pub(super) const PANEL: usize = 4;

/// One number for each output of a panel.
pub(super) type Panel = [f32; PANEL];

/// Weights and values with a magnitude below this are replaced by 0. So no product and no sum is ever subnormal: many
/// processors take a hundred times as long for subnormal numbers as for others.
pub(crate) const LEAST_MAGNITUDE: f32 = 1.0 / (1u64 << 50) as f32;

/// A weight or a value, or 0 where its magnitude is too small.
#[inline(always)]
pub(crate) fn kept(value: f32) -> f32 {
    // NaN is kept.
    if value.abs() < LEAST_MAGNITUDE { 0.0 } else { value }
}

/// Nanoseconds of a product of four outputs with one input at eight places.
const PRODUCT_NANOSECONDS: u64 = 4;
/// Nanoseconds of a matrix without inputs.
const MATRIX_NANOSECONDS: u64 = 10;
/// Nanoseconds to gather one channel of a window at eight places.
pub(super) const GATHER_NANOSECONDS: u64 = 8;

/// `y = W x + b`, with `W` in the memory layout of [`Matrix::apply`].
#[derive(Clone, Debug)]
pub(super) struct Matrix {
    columns: usize,
    outputs: usize,
    /// For four outputs at a time, their weights column by column. Zeros fill up the last four.
    weights: Vec<Panel>,
    bias: Vec<Panel>,
}

impl Matrix {
    /// A matrix with `columns` inputs, and one output for each element of `bias`.
    pub(super) fn new(columns: usize, bias: &[f32], weight: impl Fn(usize, usize) -> f32) -> Self {
        let outputs = bias.len();
        let panel = |first: usize, value: &dyn Fn(usize) -> f32| {
            let mut panel = [0.0; PANEL];
            (first..outputs).zip(&mut panel).for_each(|(row, slot)| *slot = kept(value(row)));
            panel
        };
        let panels = || (0..outputs).step_by(PANEL);
        let mut weights = Vec::with_capacity(outputs.div_ceil(PANEL) * columns);
        for first in panels() {
            weights.extend((0..columns).map(|column| panel(first, &|row| weight(row, column))));
        }
        Self { columns, outputs, weights, bias: panels().map(|first| panel(first, &|row| bias[row])).collect() }
    }

    /// From a weight `[outputs, inputs]` row-major.
    pub(super) fn from_rows(weight: &[f32], bias: &[f32]) -> Self {
        let columns = weight.len() / bias.len();
        Self::new(columns, bias, |row, column| weight[row * columns + column])
    }

    pub(super) fn outputs(&self) -> usize {
        self.outputs
    }

    /// Nanoseconds at eight places.
    pub(super) fn nanoseconds(&self) -> u64 {
        self.bias.len() as u64 * (MATRIX_NANOSECONDS + PRODUCT_NANOSECONDS * self.columns as u64)
    }

    /// Bytes of a matrix of so many columns and outputs, with the overhead of vectors and allocator.
    pub(super) fn bytes(columns: u64, outputs: u64) -> u64 {
        let panels = outputs.div_ceil(PANEL as u64);
        panels.saturating_mul(columns.saturating_add(1)).saturating_mul(size_of::<Panel>() as u64).saturating_add(128)
    }

    /// Each output is its bias plus the products with the inputs, in their order. If there are fewer `inputs` than
    /// columns, the missing ones are not in the sums.
    #[inline(always)]
    pub(super) fn apply(&self, inputs: &[Lanes], outputs: &mut [Lanes]) {
        debug_assert!(inputs.len() <= self.columns && outputs.len() == self.outputs);
        let weights = self.weights.chunks_exact(self.columns);
        for ((weights, bias), outputs) in weights.zip(&self.bias).zip(outputs.chunks_mut(PANEL)) {
            let sums = panel_sums(weights, inputs, bias);
            for (output, sum) in outputs.iter_mut().zip(&sums) {
                *output = sum.map(kept);
            }
        }
    }
}

/// Inlined into what runs in the vectors of the processor (see [`crate::vectors`]); elsewhere a separate and simple function, so that
/// the compiler keeps the sums in vector registers.
#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
#[cfg_attr(target_arch = "x86_64", inline(always))]
#[cfg_attr(not(target_arch = "x86_64"), inline(never))]
fn panel_sums(weights: &[Panel], inputs: &[Lanes], bias: &Panel) -> [Lanes; PANEL] {
    let mut sums = bias.map(|bias| [bias; LANES]);
    for (weights, input) in weights.iter().zip(inputs) {
        for (sum, weight) in sums.iter_mut().zip(weights) {
            for (sum, input) in sum.iter_mut().zip(input) {
                *sum += weight * input;
            }
        }
    }
    sums
}

/// As above, with the vectors written out: for WebAssembly the compiler makes scalars of the loops, which take four
/// times as long. The same products and sums, to the last bit.
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
#[inline(never)]
fn panel_sums(weights: &[Panel], inputs: &[Lanes], bias: &Panel) -> [Lanes; PANEL] {
    use core::arch::wasm32::{f32x4, f32x4_add, f32x4_extract_lane as lane, f32x4_mul, f32x4_splat};
    let mut sums = bias.map(|bias| [f32x4_splat(bias); 2]);
    for (weights, &[a, b, c, d, e, f, g, h]) in weights.iter().zip(inputs) {
        let input = [f32x4(a, b, c, d), f32x4(e, f, g, h)];
        for (sums, &weight) in sums.iter_mut().zip(weights) {
            *sums = [0, 1].map(|half| f32x4_add(sums[half], f32x4_mul(f32x4_splat(weight), input[half])));
        }
    }
    sums.map(|[a, b]| {
        [lane::<0>(a), lane::<1>(a), lane::<2>(a), lane::<3>(a), lane::<0>(b), lane::<1>(b), lane::<2>(b), lane::<3>(b)]
    })
}
