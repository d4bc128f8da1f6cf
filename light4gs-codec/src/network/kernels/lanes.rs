//! A linear layer at eight positions at a time.

/// Positions that are computed together.
pub(crate) const LANES: usize = 8;
/// One channel at [`LANES`] positions.
pub(crate) type Lanes = [f32; LANES];
/// Most outputs that are computed together: as many sums as the registers hold, since additions wait for each other where
/// there are fewer. Vectors of WebAssembly have four numbers, so that a sum takes two.
const WIDEST: usize = if cfg!(target_arch = "wasm32") { 4 } else { 8 };

/// Weights and values with a magnitude below this are replaced by 0. So no product and no sum is ever subnormal: many
/// processors take a hundred times as long for subnormal numbers as for others.
pub(crate) const LEAST_MAGNITUDE: f32 = 1.0 / (1u64 << 50) as f32;

/// A weight or a value, or 0 where its magnitude is too small.
#[inline(always)]
pub(crate) fn kept(value: f32) -> f32 {
    // NaN is kept.
    if value.abs() < LEAST_MAGNITUDE { 0.0 } else { value }
}

/// Number of outputs whose cost is counted together: not the width of a panel, since a cost must be the same on every
/// machine.
const COUNTED: usize = 4;
/// Nanoseconds to add one input to [`COUNTED`] outputs at eight places.
const PRODUCT_NANOSECONDS: u64 = 4;
/// Nanoseconds of a matrix without inputs.
const MATRIX_NANOSECONDS: u64 = 10;
/// Nanoseconds to gather one channel of a window at eight places.
pub(super) const GATHER_NANOSECONDS: u64 = 8;

/// `y = W x + b`.
#[derive(Clone, Debug)]
pub(super) struct Matrix {
    columns: usize,
    outputs: usize,
    /// Panel by panel, with [`panel_width`] outputs each: the biases of its outputs, then their weights column by
    /// column.
    panels: Vec<f32>,
}

/// Outputs of the next panel, of those that are `left`.
fn panel_width(left: usize) -> usize {
    WIDEST.min(1 << left.ilog2())
}

impl Matrix {
    /// A matrix with `columns` inputs, and one output for each element of `bias`.
    pub(super) fn new(columns: usize, bias: &[f32], weight: impl Fn(usize, usize) -> f32) -> Self {
        let outputs = bias.len();
        let mut panels = Vec::with_capacity((columns + 1) * outputs);
        let mut first = 0;
        while first < outputs {
            let rows = first..first + panel_width(outputs - first);
            first = rows.end;
            panels.extend(bias[rows.clone()].iter().map(|&bias| kept(bias)));
            for column in 0..columns {
                panels.extend(rows.clone().map(|row| kept(weight(row, column))));
            }
        }
        Self { columns, outputs, panels }
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
        self.outputs.div_ceil(COUNTED) as u64 * (MATRIX_NANOSECONDS + PRODUCT_NANOSECONDS * self.columns as u64)
    }

    /// Bytes of a matrix with these numbers of columns and outputs, and the overhead of vectors and allocator.
    pub(super) fn bytes(columns: u64, outputs: u64) -> u64 {
        let counted = outputs.div_ceil(COUNTED as u64) * (COUNTED * size_of::<f32>()) as u64;
        counted.saturating_mul(columns.saturating_add(1)).saturating_add(128)
    }

    /// Each output is its bias plus the products with the inputs, in their order. If there are fewer `inputs` than
    /// columns, the missing ones are not in the sums.
    #[inline(always)]
    pub(super) fn apply(&self, inputs: &[Lanes], outputs: &mut [Lanes]) {
        debug_assert!(inputs.len() <= self.columns && outputs.len() == self.outputs);
        let (mut panels, mut rest) = (&self.panels[..], outputs);
        while rest.len() >= WIDEST {
            (panels, rest) = self.apply_panel::<WIDEST>(panels, inputs, rest);
        }
        if rest.len() >= 4 {
            (panels, rest) = self.apply_panel::<4>(panels, inputs, rest);
        }
        if rest.len() >= 2 {
            (panels, rest) = self.apply_panel::<2>(panels, inputs, rest);
        }
        if !rest.is_empty() {
            self.apply_panel::<1>(panels, inputs, rest);
        }
    }

    /// Computes the outputs of the first panel; returns the other panels and outputs.
    #[inline(always)]
    fn apply_panel<'a, const WIDTH: usize>(
        &self,
        panels: &'a [f32],
        inputs: &[Lanes],
        outputs: &'a mut [Lanes],
    ) -> (&'a [f32], &'a mut [Lanes]) {
        let (panel, panels) = panels.split_at((self.columns + 1) * WIDTH);
        let (bias, weights) = panel.as_chunks::<WIDTH>().0.split_first().expect("a panel begins with biases");
        let (own, outputs) = outputs.split_first_chunk_mut::<WIDTH>().expect("an output for each bias");
        *own = panel_sums(weights, inputs, bias).map(|sums| sums.map(kept));
        (panels, outputs)
    }
}

/// On x86-64 inlined, to be compiled for the vectors of the processor (see [`crate::vectors`]). Elsewhere a separate
/// and simple function, so that the compiler keeps the sums in vector registers.
#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
#[cfg_attr(target_arch = "x86_64", inline(always))]
#[cfg_attr(not(target_arch = "x86_64"), inline(never))]
fn panel_sums<const WIDTH: usize>(weights: &[[f32; WIDTH]], inputs: &[Lanes], bias: &[f32; WIDTH]) -> [Lanes; WIDTH] {
    let product = |sum: Lanes, weight: f32, input: &Lanes| std::array::from_fn(|lane| sum[lane] + weight * input[lane]);
    let mut sums = bias.map(|bias| [bias; LANES]);
    // With loops over the sums in place of new arrays, the compiler does not keep eight of them in registers.
    for (weights, input) in weights.iter().zip(inputs) {
        sums = std::array::from_fn(|output| product(sums[output], weights[output], input));
    }
    sums
}

/// As above, with the vectors written out: for WebAssembly the compiler makes scalars of the loops, which take four
/// times as long. The same products and sums, to the last bit.
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
#[inline(never)]
fn panel_sums<const WIDTH: usize>(weights: &[[f32; WIDTH]], inputs: &[Lanes], bias: &[f32; WIDTH]) -> [Lanes; WIDTH] {
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
