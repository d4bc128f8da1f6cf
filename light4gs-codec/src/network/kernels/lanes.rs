//! A linear layer on eight positions at a time.

/// Positions that are computed together.
pub(crate) const LANES: usize = 8;
/// One channel at [`LANES`] positions.
pub(crate) type Lanes = [f32; LANES];
/// Outputs that are computed together.
const PANEL: usize = 4;

/// One number for each output of a panel.
type Panel = [f32; PANEL];

/// `y = W x + b`, with `W` laid out for [`Matrix::apply`].
#[derive(Clone, Debug)]
pub(super) struct Matrix {
    columns: usize,
    outputs: usize,
    /// For four outputs at a time, their weights column by column. Zeros fill up the last four.
    weights: Vec<Panel>,
    bias: Vec<Panel>,
}

impl Matrix {
    /// `columns` inputs, one output for each of `bias`.
    pub(super) fn new(columns: usize, bias: &[f32], weight: impl Fn(usize, usize) -> f32) -> Self {
        let outputs = bias.len();
        let panel = |first: usize, value: &dyn Fn(usize) -> f32| {
            let mut panel = [0.0; PANEL];
            (first..outputs).zip(&mut panel).for_each(|(row, slot)| *slot = value(row));
            panel
        };
        let panels = || (0..outputs).step_by(PANEL);
        let columns_of = |first| (0..columns).map(move |column| (first, column));
        Self {
            columns,
            outputs,
            weights: panels().flat_map(columns_of).map(|(first, c)| panel(first, &|row| weight(row, c))).collect(),
            bias: panels().map(|first| panel(first, &|row| bias[row])).collect(),
        }
    }

    /// From a weight `[outputs, inputs]` row-major.
    pub(super) fn from_rows(weight: &[f32], bias: &[f32]) -> Self {
        let columns = weight.len() / bias.len();
        Self::new(columns, bias, |row, column| weight[row * columns + column])
    }

    pub(super) fn outputs(&self) -> usize {
        self.outputs
    }

    /// Outputs with those that fill up the last four, which cost as much.
    pub(super) fn padded_outputs(&self) -> usize {
        PANEL * self.bias.len()
    }

    /// Each output is its bias plus the products with the inputs, in their order. Where `inputs` are fewer than the
    /// columns, the others do not take part.
    pub(super) fn apply(&self, inputs: &[Lanes], outputs: &mut [Lanes]) {
        debug_assert!(inputs.len() <= self.columns && outputs.len() == self.outputs);
        let weights = self.weights.chunks_exact(self.columns);
        for ((weights, bias), outputs) in weights.zip(&self.bias).zip(outputs.chunks_mut(PANEL)) {
            let sums = panel_sums(weights, inputs, bias);
            outputs.copy_from_slice(&sums[..outputs.len()]);
        }
    }
}

/// A function of its own, and this plain, so that the sums stay in vector registers.
#[inline(never)]
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
