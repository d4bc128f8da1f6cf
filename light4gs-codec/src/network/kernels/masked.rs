//! The checkerboard-masked convolution: from the decoded anchors to the other positions (paper III-C).

use super::{
    Columns, Lanes, PaddedMap, kept,
    lanes::{GATHER_NANOSECONDS, Matrix},
};
use crate::network::Layer;

/// The anchors of a plane (row + column is odd), packed to half the width.
#[derive(Clone, Debug)]
pub(crate) struct AnchorMap {
    packed: PaddedMap,
}

/// The rows, and packed columns, that the largest window extends beyond its center.
const REACH: usize = 3;

/// Positions in a kernel, row-major, that the checkerboard mask keeps: row plus column is odd.
pub(crate) fn masked_taps(kernel: u32) -> impl Iterator<Item = usize> {
    (0..kernel * kernel).filter(move |tap| (tap / kernel + tap % kernel) % 2 == 1).map(|tap| tap as usize)
}

impl AnchorMap {
    /// The anchors of a plane `[channels, height, width]` (even width), with `center` subtracted.
    pub(crate) fn new(values: &[f32], [height, width]: [usize; 2], center: f32) -> Self {
        let mut packed = PaddedMap::zeros(values.len() / (height * width), height, width / 2, REACH);
        for (index, row) in values.chunks_exact(width).enumerate() {
            let y = index % height;
            let anchors = row[first_anchor(y)..].iter().step_by(2);
            for (target, &value) in packed.row_mut(index / height, y).iter_mut().zip(anchors) {
                *target = kept(value - center);
            }
        }
        Self { packed }
    }
}

/// Column of the first anchor of a row.
pub(crate) fn first_anchor(y: usize) -> usize {
    1 - y % 2
}

/// A convolution that reads only positions at an odd distance (rows plus columns), with groups.
///
/// Order of an output's sum: bias, then input channels of its group, kernel rows, the unmasked kernel columns.
#[derive(Clone, Debug)]
pub(crate) struct MaskedConvolution {
    groups: Vec<Matrix>,
    inputs_per_group: usize,
    /// The unmasked taps, as rows and columns from the center.
    taps: Vec<(isize, isize)>,
}

impl MaskedConvolution {
    /// From a layer that has been checked. Its masked weights are ignored.
    pub(crate) fn new(layer: &Layer) -> Self {
        let groups = layer.groups as usize;
        let (outputs, inputs) = (layer.outputs as usize / groups, layer.inputs as usize / groups);
        let taps: Vec<_> = masked_taps(layer.kernel).collect();
        let kernel = layer.kernel as usize;
        let area = kernel * kernel;
        let offset = |place: usize| place as isize - (kernel / 2) as isize;
        let matrix = |group: usize| {
            let bias = &layer.bias[group * outputs..(group + 1) * outputs];
            Matrix::new(inputs * taps.len(), bias, |row, column| {
                let channel = (group * outputs + row) * inputs + column / taps.len();
                layer.weight[channel * area + taps[column % taps.len()]]
            })
        };
        let groups = (0..groups).map(matrix).collect();
        let taps = taps.iter().map(|tap| (offset(tap / kernel), offset(tap % kernel))).collect();
        Self { groups, inputs_per_group: inputs, taps }
    }

    /// The outputs at eight neighboring non-anchors of row `y`, the first of which is number `first` of its row.
    #[inline(always)]
    pub(crate) fn apply(
        &self,
        anchors: &AnchorMap,
        y: usize,
        first: usize,
        window: &mut Vec<Lanes>,
        mut outputs: &mut [Lanes],
    ) {
        // The non-anchor number j of row y stands in column 2j + parity, the anchor number i of the row beside it in
        // column 2i + parity, those of its own row and of the second next in 2i + 1 - parity.
        let parity = (y % 2) as isize;
        let columns = Columns { first, step: 1 };
        for (index, group) in self.groups.iter().enumerate() {
            window.clear();
            for channel in index * self.inputs_per_group..(index + 1) * self.inputs_per_group {
                for &(dy, dx) in &self.taps {
                    let anchor_parity = if dy % 2 == 0 { 1 - parity } else { parity };
                    let packed_dx = (parity + dx - anchor_parity) / 2;
                    window.push(anchors.packed.lanes(channel, y, columns, dy, packed_dx));
                }
            }
            let (own, others) = outputs.split_at_mut(group.outputs());
            group.apply(window, own);
            outputs = others;
        }
    }

    /// Nanoseconds of [`MaskedConvolution::apply`].
    pub(crate) fn nanoseconds(&self) -> u64 {
        let products: u64 = self.groups.iter().map(Matrix::nanoseconds).sum();
        products + GATHER_NANOSECONDS * self.groups.len() as u64 * self.window()
    }

    /// Inputs that an output reads.
    pub(crate) fn window(&self) -> u64 {
        (self.inputs_per_group * self.taps.len()) as u64
    }
}
