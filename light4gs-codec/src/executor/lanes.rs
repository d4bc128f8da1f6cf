//! A linear layer on eight positions at a time.

/// Positions that are computed together.
pub(crate) const LANES: usize = 8;
/// One channel at [`LANES`] positions.
pub(crate) type Lanes = [f32; LANES];
/// Outputs that are computed together.
const PANEL: usize = 4;

/// `y = W x + b`, with `W` laid out for [`Matrix::apply`].
#[derive(Clone, Debug)]
pub(super) struct Matrix {
    columns: usize,
    /// For four outputs at a time, their weights column by column; zeros fill up the last four.
    panels: Vec<[f32; PANEL]>,
    bias: Vec<f32>,
}

impl Matrix {
    /// `columns` inputs, one output for each of `bias`.
    pub(super) fn new(columns: usize, bias: &[f32], weight: impl Fn(usize, usize) -> f32) -> Self {
        let mut panels = Vec::with_capacity(bias.len().div_ceil(PANEL) * columns);
        for first in (0..bias.len()).step_by(PANEL) {
            for column in 0..columns {
                let mut weights = [0.0; PANEL];
                for (row, slot) in (first..bias.len()).zip(&mut weights) {
                    *slot = weight(row, column);
                }
                panels.push(weights);
            }
        }
        Self { columns, panels, bias: bias.to_vec() }
    }

    /// From a weight `[outputs, inputs]` row-major.
    pub(super) fn from_rows(weight: &[f32], bias: &[f32]) -> Self {
        let columns = weight.len() / bias.len();
        Self::new(columns, bias, |row, column| weight[row * columns + column])
    }

    pub(super) fn outputs(&self) -> usize {
        self.bias.len()
    }

    /// Each output is its bias plus the products with the inputs, in their order. Where `inputs` are fewer than the
    /// columns, the others do not take part.
    pub(super) fn apply(&self, inputs: &[Lanes], outputs: &mut [Lanes]) {
        debug_assert!(inputs.len() <= self.columns && outputs.len() == self.outputs());
        let panels = self.panels.chunks_exact(self.columns);
        for ((panel, bias), outputs) in panels.zip(self.bias.chunks(PANEL)).zip(outputs.chunks_mut(PANEL)) {
            let mut sums = [[0.0; LANES]; PANEL];
            for (sum, &bias) in sums.iter_mut().zip(bias) {
                *sum = [bias; LANES];
            }
            for (weights, input) in panel.iter().zip(inputs) {
                for row in 0..PANEL {
                    for lane in 0..LANES {
                        sums[row][lane] += weights[row] * input[lane];
                    }
                }
            }
            outputs.copy_from_slice(&sums[..outputs.len()]);
        }
    }
}

/// `x` where it is at least 0, else `0.01 x`.
pub(super) fn leaky_relu(values: &mut [Lanes]) {
    for lanes in values {
        for value in lanes {
            *value = if *value >= 0.0 { *value } else { 0.01 * *value };
        }
    }
}
