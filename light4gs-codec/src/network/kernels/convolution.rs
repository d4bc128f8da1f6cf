//! Convolutions with groups as in PyTorch.

use super::{
    Columns, Lanes, PaddedMap,
    lanes::{GATHER_NANOSECONDS, Matrix},
};
use crate::network::Layer;

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
    /// From a layer that has been checked.
    pub(crate) fn new(layer: &Layer) -> Self {
        let (groups, kernel) = (layer.groups as usize, layer.kernel as usize);
        let (outputs, inputs_per_group) = (layer.outputs as usize / groups, layer.inputs as usize / groups);
        let weights = layer.weight.chunks_exact(layer.weight.len() / groups);
        let groups = weights.zip(layer.bias.chunks_exact(outputs)).map(|(w, b)| Matrix::from_rows(w, b)).collect();
        Self { groups, inputs_per_group, kernel }
    }

    /// The outputs around `columns` of row `y` of the input, which has a border of half the kernel. `window` is scratch
    /// memory.
    #[inline(always)]
    pub(crate) fn apply(
        &self,
        map: &PaddedMap,
        y: usize,
        columns: Columns,
        window: &mut Vec<Lanes>,
        mut outputs: &mut [Lanes],
    ) {
        let reach = (self.kernel / 2) as isize;
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

    /// The outputs of a kernel of side 1 from the inputs at eight positions. Without groups, inputs may be left out at
    /// the end; they are then not in the sums.
    #[inline(always)]
    pub(crate) fn apply_pointwise(&self, inputs: &[Lanes], mut outputs: &mut [Lanes]) {
        if let [group] = &self.groups[..] {
            return group.apply(inputs, outputs);
        }
        for (group, inputs) in self.groups.iter().zip(inputs.chunks_exact(self.inputs_per_group)) {
            let (own, others) = outputs.split_at_mut(group.outputs());
            group.apply(inputs, own);
            outputs = others;
        }
    }

    /// Whether [`Convolution::apply_pointwise`] may be given fewer inputs.
    pub(crate) fn takes_fewer_inputs(&self) -> bool {
        self.groups.len() == 1
    }

    /// Nanoseconds of [`Convolution::apply_pointwise`].
    pub(crate) fn pointwise_nanoseconds(&self) -> u64 {
        self.groups.iter().map(Matrix::nanoseconds).sum()
    }

    /// Nanoseconds of [`Convolution::apply`].
    pub(crate) fn nanoseconds(&self) -> u64 {
        self.pointwise_nanoseconds() + GATHER_NANOSECONDS * self.groups.len() as u64 * self.window()
    }

    /// Inputs that an output reads.
    pub(crate) fn window(&self) -> u64 {
        (self.inputs_per_group * self.kernel * self.kernel) as u64
    }

    /// Bytes of [`Convolution::new`].
    pub(crate) fn bytes(layer: &Layer) -> u64 {
        let groups = u64::from(layer.groups.max(1));
        let window = u64::from(layer.inputs) / groups * u64::from(layer.kernel) * u64::from(layer.kernel);
        groups.saturating_mul(Matrix::bytes(window, u64::from(layer.outputs) / groups))
    }
}
