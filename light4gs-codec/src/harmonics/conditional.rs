//! Distributions from small networks.

use super::{ShCondition, group};
use crate::{
    GaussianArrays, HexPlaneArrays, LinearLayer, SceneFrameArrays,
    executor::{LANES, Lanes, TwoLayers},
    query::{multiply_by_sample, normalised},
    sections::hexplanes::AXES,
};

/// Inputs and outputs of the layers that a condition asks for, with the hidden width of each network.
pub(crate) fn layer_shapes(condition: ShCondition, degree: u8, features: u64, hidden: &[u32]) -> Vec<(u64, u64)> {
    let channels = |degree: usize| group(degree).1 as u64;
    match (condition, hidden) {
        (ShCondition::Autoregressive, hidden) => (1..=usize::from(degree))
            .zip(hidden)
            .flat_map(|(degree, &hidden)| {
                let inputs = 3 + group(degree).0 as u64;
                [(inputs, hidden.into()), (hidden.into(), 2 * channels(degree))]
            })
            .collect(),
        (ShCondition::HexplaneCoupled, &[hidden, ..]) if degree > 0 => {
            let channels: u64 = (1..=usize::from(degree)).map(channels).sum();
            vec![(features, hidden.into()), (hidden.into(), 2 * channels)]
        }
        _ => Vec::new(),
    }
}

/// The networks, and what they see.
#[derive(Debug)]
pub(crate) struct Conditional<'a> {
    condition: ShCondition,
    networks: Vec<TwoLayers>,
    gaussians: &'a GaussianArrays,
    frame: &'a SceneFrameArrays,
    hexplane: &'a HexPlaneArrays,
    /// Inputs of [`LANES`] Gaussians.
    inputs: Vec<Lanes>,
    /// Scales and means `[2 · channels]` of a degree, or of all degrees.
    outputs: Vec<Lanes>,
}

impl<'a> Conditional<'a> {
    /// From layers whose shapes are sound and what is decoded already.
    pub(super) fn new(
        condition: ShCondition,
        layers: &[LinearLayer],
        gaussians: &'a GaussianArrays,
        frame: &'a SceneFrameArrays,
        hexplane: &'a HexPlaneArrays,
    ) -> Self {
        let networks = layers.as_chunks::<2>().0.iter().map(|pair| TwoLayers::new(pair.each_ref())).collect();
        Self { condition, networks, gaussians, frame, hexplane, inputs: Vec::new(), outputs: Vec::new() }
    }

    /// Scales and means of the channels of one degree, for the Gaussians from `first` on. Degrees rise; `values` are
    /// those of all channels, `[Gaussians, channels]`, of which the lower degrees are decoded.
    pub(super) fn parameters(
        &mut self,
        degree: usize,
        first: usize,
        values: &[f32],
        channels: usize,
    ) -> (&[Lanes], &[Lanes]) {
        let lanes = LANES.min(self.gaussians.len() - first);
        let (offset, count) = group(degree);
        match self.condition {
            ShCondition::Autoregressive => {
                self.inputs.clear();
                self.inputs.resize(3 + offset, [0.0; LANES]);
                for lane in 0..lanes {
                    let gaussian = first + lane;
                    let lower = &values[gaussian * channels..gaussian * channels + offset];
                    let known = self.gaussians.sh_dc[gaussian].iter().chain(lower);
                    self.inputs.iter_mut().zip(known).for_each(|(input, &value)| input[lane] = value);
                }
                self.outputs.resize(2 * count, [0.0; LANES]);
                self.networks[degree - 1].apply(&self.inputs, &mut self.outputs);
                self.outputs.split_at(count)
            }
            ShCondition::HexplaneCoupled => {
                if degree == 1 {
                    self.couple(first, lanes);
                    self.outputs.resize(2 * channels, [0.0; LANES]);
                    self.networks[0].apply(&self.inputs, &mut self.outputs);
                }
                let (scales, means) = self.outputs.split_at(channels);
                (&scales[offset..offset + count], &means[offset..offset + count])
            }
        }
    }

    /// Inputs from the space-only planes.
    fn couple(&mut self, first: usize, lanes: usize) {
        let channels = self.hexplane.channels as usize;
        let scales = self.hexplane.multipliers.len();
        self.inputs.clear();
        self.inputs.resize(channels * scales, [0.0; LANES]);
        let mut product = vec![1.0; channels];
        for lane in 0..lanes {
            let coordinates = normalised(self.frame, self.gaussians.means[first + lane]);
            for (planes, inputs) in self.hexplane.planes.chunks_exact(6).zip(self.inputs.chunks_exact_mut(channels)) {
                product.fill(1.0);
                for (plane, (across, down)) in planes.iter().zip(AXES) {
                    if let (Some(&across), Some(&down)) = (coordinates.get(across), coordinates.get(down)) {
                        multiply_by_sample(plane, across, down, &mut product);
                    }
                }
                inputs.iter_mut().zip(&product).for_each(|(input, &value)| input[lane] = value);
            }
        }
    }
}
