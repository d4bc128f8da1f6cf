//! Convolutions of stride 1 that keep the size, with groups as in PyTorch.

use super::{Columns, Lanes, PaddedMap, lanes::Matrix};
use crate::ConvolutionLayer;

/// A convolution with an odd kernel and zeros beyond the border, which take part in the sums.
///
/// Order of an output's sum: bias, then input channels of its group, kernel rows, kernel columns, all ascending.
#[derive(Clone, Debug)]
pub(crate) struct Convolution {
    groups: Vec<Matrix>,
    inputs_per_group: usize,
    kernel: usize,
}

impl Convolution {
    /// From a layer whose shape is sound.
    pub(crate) fn new(layer: &ConvolutionLayer) -> Self {
        let shape = &layer.shape;
        let (groups, kernel) = (shape.groups as usize, shape.kernel as usize);
        let (outputs, inputs_per_group) = (shape.outputs as usize / groups, shape.inputs as usize / groups);
        let weights = layer.weight.chunks_exact(layer.weight.len() / groups);
        let groups = weights.zip(layer.bias.chunks_exact(outputs)).map(|(w, b)| Matrix::from_rows(w, b)).collect();
        Self { groups, inputs_per_group, kernel }
    }

    /// Zeros that the input needs around it.
    pub(crate) fn border(&self) -> usize {
        self.kernel / 2
    }

    /// The outputs at `columns` of row `y`. `window` is memory to work in.
    pub(crate) fn apply(
        &self,
        map: &PaddedMap,
        y: usize,
        columns: Columns,
        window: &mut Vec<Lanes>,
        mut outputs: &mut [Lanes],
    ) {
        let reach = self.border() as isize;
        for (index, group) in self.groups.iter().enumerate() {
            window.clear();
            for channel in index * self.inputs_per_group..(index + 1) * self.inputs_per_group {
                for dy in -reach..=reach {
                    for dx in -reach..=reach {
                        window.push(map.lanes(channel, y, columns, dy, dx));
                    }
                }
            }
            let (own, others) = outputs.split_at_mut(group.outputs());
            group.apply(window, own);
            outputs = others;
        }
    }
}
