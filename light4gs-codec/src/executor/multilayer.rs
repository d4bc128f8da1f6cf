//! The networks of the conditional spherical harmonics.

use super::{
    LANES, Lanes,
    lanes::{Matrix, leaky_relu},
};
use crate::LinearLayer;

/// Linear, LeakyReLU, linear.
#[derive(Clone, Debug)]
pub(crate) struct TwoLayers {
    layers: [Matrix; 2],
    hidden: Vec<Lanes>,
}

impl TwoLayers {
    /// From layers whose shapes are sound.
    pub(crate) fn new(layers: [&LinearLayer; 2]) -> Self {
        let layers = layers.map(|layer| Matrix::from_rows(&layer.weight, &layer.bias));
        let hidden = vec![[0.0; LANES]; layers[0].outputs()];
        Self { layers, hidden }
    }

    /// The outputs for [`LANES`] Gaussians.
    pub(crate) fn apply(&mut self, inputs: &[Lanes], outputs: &mut [Lanes]) {
        self.layers[0].apply(inputs, &mut self.hidden);
        leaky_relu(&mut self.hidden);
        self.layers[1].apply(&self.hidden, outputs);
    }
}
