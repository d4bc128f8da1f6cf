//! `entropy_parameters`: the pointwise network behind every scale and mean.

use super::{
    LANES, Lanes,
    lanes::{Matrix, leaky_relu},
};
use crate::ConvolutionLayer;

/// Three 1 x 1 convolutions with LeakyReLU between: `4M -> C -> D -> 2M`, scales then means.
#[derive(Clone, Debug)]
pub(crate) struct EntropyParameters {
    layers: [Matrix; 3],
}

impl EntropyParameters {
    /// From the layers `entropy_parameters.0`, `.2`, `.4`, whose shapes are sound.
    pub(crate) fn new(layers: [&ConvolutionLayer; 3]) -> Self {
        Self { layers: layers.map(|layer| Matrix::from_rows(&layer.weight, &layer.bias)) }
    }

    /// Scales and means `[2M]` in `outputs`, from parameters `[2M]` and context `[2M]`; a context of zeros may be left
    /// out.
    pub(crate) fn apply(&self, inputs: &[Lanes], hidden: &mut Hidden, outputs: &mut [Lanes]) {
        let Hidden { first, second } = hidden;
        first.resize(self.layers[0].outputs(), [0.0; LANES]);
        second.resize(self.layers[1].outputs(), [0.0; LANES]);
        self.layers[0].apply(inputs, first);
        leaky_relu(first);
        self.layers[1].apply(first, second);
        leaky_relu(second);
        self.layers[2].apply(second, outputs);
    }
}

/// Memory for the hidden layers.
#[derive(Debug, Default)]
pub(crate) struct Hidden {
    first: Vec<Lanes>,
    second: Vec<Lanes>,
}
