//! Transposed convolutions that double the size.

use super::{
    Columns, LANES, Lanes, PaddedMap,
    lanes::{GATHER_NANOSECONDS, Matrix},
};
use crate::network::Layer;

/// A transposed convolution with kernel 5, stride 2, padding 2 and output padding 1: `[I, H, W]` to `[O, 2H, 2W]`.
///
/// Order of an output's sum: bias, then input channels, kernel rows, kernel columns, ascending, as far as they reach
/// the output.
#[derive(Clone, Debug)]
pub(crate) struct TransposedConvolution {
    /// For outputs in even and odd rows, in even and odd columns each: an ordinary convolution of the input.
    phases: [[Matrix; 2]; 2],
    inputs: usize,
}

const KERNEL: usize = 5;

/// Kernel indices that reach outputs of a parity, and the position of their input, relative to half the output's
/// position: output `y` takes input `(y + 2 - k) / 2` for each `k` of its own parity.
const TAPS: [&[(usize, isize)]; 2] = [&[(0, 1), (2, 0), (4, -1)], &[(1, 1), (3, 0)]];

impl TransposedConvolution {
    /// From a layer that has been checked; its weight is `[inputs, outputs, 5, 5]`.
    pub(crate) fn new(layer: &Layer) -> Self {
        let (inputs, outputs) = (layer.inputs as usize, layer.outputs as usize);
        let phase = |rows: &[(usize, isize)], columns: &[(usize, isize)]| {
            let taps = rows.len() * columns.len();
            Matrix::new(inputs * taps, &layer.bias, |output, column| {
                let (input, tap) = (column / taps, column % taps);
                let (ky, kx) = (rows[tap / columns.len()].0, columns[tap % columns.len()].0);
                layer.weight[((input * outputs + output) * KERNEL + ky) * KERNEL + kx]
            })
        };
        Self { phases: [0, 1].map(|y| [0, 1].map(|x| phase(TAPS[y], TAPS[x]))), inputs }
    }

    /// The whole output with a border of its own. The input needs a border of 1.
    #[inline(always)]
    pub(crate) fn apply(&self, map: &PaddedMap, border: usize, activation: impl Fn(&mut [Lanes])) -> PaddedMap {
        let outputs = self.phases[0][0].outputs();
        let mut doubled = PaddedMap::zeros(outputs, 2 * map.height, 2 * map.width, border);
        let mut window = Vec::new();
        let mut sums = vec![[0.0; LANES]; outputs];
        for y in 0..2 * map.height {
            for parity in 0..2 {
                for first in (0..map.width).step_by(LANES) {
                    window.clear();
                    for channel in 0..self.inputs {
                        for &(_, dy) in TAPS[y % 2] {
                            for &(_, dx) in TAPS[parity] {
                                window.push(map.lanes(channel, y / 2, Columns { first, step: 1 }, dy, dx));
                            }
                        }
                    }
                    self.phases[y % 2][parity].apply(&window, &mut sums);
                    activation(&mut sums);
                    for (channel, lanes) in sums.iter().enumerate() {
                        let targets = doubled.row_mut(channel, y)[parity..].iter_mut().step_by(2).skip(first);
                        targets.zip(lanes).for_each(|(target, &value)| *target = value);
                    }
                }
            }
        }
        doubled
    }

    /// Nanoseconds for eight places of the output, at most.
    pub(crate) fn nanoseconds(&self) -> u64 {
        self.phases[0][0].nanoseconds() + GATHER_NANOSECONDS * self.window()
    }

    /// Inputs that an output reads, at most.
    pub(crate) fn window(&self) -> u64 {
        (self.inputs * TAPS[0].len() * TAPS[0].len()) as u64
    }

    /// Bytes of [`TransposedConvolution::new`].
    pub(crate) fn bytes(layer: &Layer) -> u64 {
        let taps = TAPS.map(|rows| TAPS.map(|columns| rows.len() * columns.len()));
        let phase = |&taps: &usize| Matrix::bytes(u64::from(layer.inputs) * taps as u64, layer.outputs.into());
        taps.as_flattened().iter().map(phase).sum()
    }
}
