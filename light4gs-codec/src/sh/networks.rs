//! Distributions from networks.

use super::coding::{Conditions, ShPrior, ShSource};
use crate::{
    motion::query::{multiply_by_space_samples, normalized, scales},
    network::{
        Program, Workspace,
        kernels::{LANES, Lanes, kept},
    },
};

/// Nanoseconds to take samples of three planes at eight Gaussians.
const FEATURE_NANOSECONDS: u64 = 600;
/// Nanoseconds to gather a channel of eight Gaussians.
const INPUT_NANOSECONDS: u64 = 24;
/// Nanoseconds of a prior for eight Gaussians, without its network and inputs.
const PRIOR_NANOSECONDS: u64 = 400;

/// The networks of checked priors, and what they read.
#[derive(Debug)]
pub(super) struct Networks<'a> {
    priors: Vec<ExactPrior<'a>>,
    conditions: Conditions<'a>,
    reads_features: bool,
    /// Features of [`LANES`] Gaussians, where a prior reads them.
    features: Vec<Lanes>,
}

#[derive(Debug)]
struct ExactPrior<'a> {
    sources: &'a [ShSource],
    program: Program,
    workspace: Workspace,
    /// The first channel that it is for, and the number of channels.
    channels: (usize, usize),
}

impl<'a> Networks<'a> {
    pub(super) fn new(priors: &'a [ShPrior], conditions: Conditions<'a>) -> Self {
        let mut first = 0;
        let exact = priors.iter().map(|ShPrior { network, sources }| {
            let program = Program::pointwise(network, &vec![true; network.inputs.len()]);
            let workspace = program.workspace();
            let count = program.output_lanes(&workspace, 0).len() / 2;
            first += count;
            ExactPrior { sources, program, workspace, channels: (first - count, count) }
        });
        let priors: Vec<_> = exact.collect();
        let reads_features = priors.iter().any(|prior| prior.sources.contains(&ShSource::SpaceFeatures));
        Self { priors, conditions, reads_features, features: Vec::new() }
    }

    /// Nanoseconds for eight Gaussians.
    pub(super) fn nanoseconds(&self) -> u64 {
        let features = if self.reads_features { FEATURE_NANOSECONDS * self.conditions.features() } else { 0 };
        self.priors.iter().fold(features, |sum, prior| {
            let inputs = prior.program.input_channels().saturating_mul(INPUT_NANOSECONDS);
            sum.saturating_add(prior.program.nanoseconds()).saturating_add(inputs).saturating_add(PRIOR_NANOSECONDS)
        })
    }

    pub(super) fn len(&self) -> usize {
        self.priors.len()
    }

    /// Prepares the Gaussians from `first` on, [`LANES`] of them.
    pub(super) fn begin(&mut self, first: usize) {
        if !self.reads_features {
            return;
        }
        let Conditions { gaussians, coordinates, feature_planes } = self.conditions;
        let channels = feature_planes.channels as usize;
        self.features.clear();
        self.features.resize(channels * feature_planes.scales(), [0.0; LANES]);
        let mut product = vec![1.0; channels];
        for (lane, &mean) in gaussians.means[first..].iter().take(LANES).enumerate() {
            let coordinates = normalized(coordinates, mean);
            for (planes, features) in scales(&feature_planes.planes).zip(self.features.chunks_exact_mut(channels)) {
                product.fill(1.0);
                multiply_by_space_samples(planes, coordinates, &mut product);
                features.iter_mut().zip(&product).for_each(|(feature, &value)| feature[lane] = value);
            }
        }
    }

    /// The first channel of a prior, and scales and means of its channels, for the Gaussians from `first` on. `values`
    /// has all channels, `[Gaussians, channels]`; those of the priors before must be decoded.
    pub(super) fn parameters(
        &mut self,
        prior: usize,
        first: usize,
        values: &[f32],
        channels: usize,
    ) -> (usize, &[Lanes], &[Lanes]) {
        let Self { priors, conditions: Conditions { gaussians, coordinates, .. }, features, .. } = self;
        let ExactPrior { sources, program, workspace, channels: (start, count) } = &mut priors[prior];
        let lanes = LANES.min(gaussians.len() - first);
        for (input, source) in sources.iter().enumerate() {
            let inputs = program.input_lanes(workspace, input);
            if *source == ShSource::SpaceFeatures {
                inputs.copy_from_slice(features);
                continue;
            }
            for lane in 0..lanes {
                let gaussian = first + lane;
                let mut set =
                    |known: &[f32]| inputs.iter_mut().zip(known).for_each(|(input, &value)| input[lane] = kept(value));
                match source {
                    ShSource::Dc => set(&gaussians.sh_dc[gaussian]),
                    ShSource::Decoded => set(&values[gaussian * channels..gaussian * channels + *start]),
                    ShSource::Position => set(&normalized(coordinates, gaussians.means[gaussian])),
                    ShSource::LogScale => set(&gaussians.log_scales[gaussian]),
                    ShSource::Quaternion => set(&gaussians.quats[gaussian]),
                    ShSource::OpacityLogit => set(&[gaussians.opacity_logits[gaussian]]),
                    ShSource::SpaceFeatures => {}
                }
            }
        }
        program.run(workspace);
        let (scales, means) = program.output_lanes(workspace, 0).split_at(*count);
        (*start, scales, means)
    }
}
