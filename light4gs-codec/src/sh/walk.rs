//! The symbols of the spherical harmonics, in order.

use super::{
    coding::{Conditions, ShCoding},
    group,
    networks::Networks,
};
use crate::{
    adaptive::Damaged,
    entropy::{Distribution, SymbolCoder, gaussian_table},
    network::kernels::LANES,
    planes::{bounded_mean, nearest},
    sh_rest_coefficients,
};

/// Where distributions come from.
#[derive(Debug)]
pub(super) enum HarmonicsModel<'a> {
    /// One for each channel.
    Tables(Vec<Distribution>),
    /// Networks.
    Networks(Networks<'a>),
}

impl<'a> HarmonicsModel<'a> {
    /// From a coding that has been checked; none for one without distributions.
    pub(super) fn new(coding: &'a ShCoding, conditions: Conditions<'a>) -> Option<Self> {
        match coding {
            ShCoding::Tables { tables, .. } => {
                Some(Self::Tables(tables.iter().map(|table| table.distribution()).collect()))
            }
            ShCoding::Networks { priors, .. } => Some(Self::Networks(Networks::new(priors, conditions))),
            ShCoding::Channels { .. } => None,
        }
    }

    /// The distributions into which the table numbers of [`walk`]'s symbols point.
    pub(super) fn distributions(&self) -> &[Distribution] {
        match self {
            Self::Tables(distributions) => distributions,
            Self::Networks(_) => &gaussian_table().levels,
        }
    }

    /// Nanoseconds for eight Gaussians, without those of the symbols.
    pub(super) fn nanoseconds(&self) -> u64 {
        match self {
            Self::Tables(_) => 0,
            Self::Networks(networks) => networks.nanoseconds(),
        }
    }
}

/// Codes `values`, `[count, channels]`, with one coder for each degree. An encoder's values are replaced by the decoded
/// ones.
pub(super) fn walk<C: SymbolCoder>(
    model: &mut HarmonicsModel<'_>,
    step: f32,
    degree: u8,
    values: &mut [f32],
    coders: &mut [C],
) -> Result<(), Damaged> {
    let channels = 3 * sh_rest_coefficients(degree);
    if channels == 0 {
        return Ok(());
    }
    match model {
        HarmonicsModel::Tables(distributions) => {
            for (degree, coder) in (1..).zip(coders) {
                let (offset, count) = group(degree);
                for row in values.chunks_exact_mut(channels) {
                    for (table, value) in (offset..).zip(&mut row[offset..offset + count]) {
                        let symbol = coder.code(distributions, table as u16, || nearest(*value / step, 0.0))?;
                        *value = symbol as f32 * step;
                    }
                }
            }
        }
        HarmonicsModel::Networks(networks) => {
            let table = gaussian_table();
            // The coder of each channel.
            let coder_of: Vec<usize> =
                (0..coders.len()).flat_map(|coder| std::iter::repeat_n(coder, group(coder + 1).1)).collect();
            for first in (0..values.len() / channels).step_by(LANES) {
                networks.begin(first);
                for prior in 0..networks.len() {
                    let (start, scales, means) = networks.parameters(prior, first, values, channels);
                    let rows = values[first * channels..].chunks_exact_mut(channels).take(LANES);
                    for (lane, row) in rows.enumerate() {
                        for (channel, (scale, mean)) in (start..).zip(scales.iter().zip(means)) {
                            let (mean, level) = (bounded_mean(mean[lane]), table.level(scale[lane]));
                            let (coder, value) = (&mut coders[coder_of[channel]], &mut row[channel]);
                            let symbol = coder.code(&table.levels, level, || nearest(*value / step, mean))?;
                            *value = (symbol as f32 + mean) * step;
                        }
                    }
                }
            }
        }
    }
    Ok(())
}
