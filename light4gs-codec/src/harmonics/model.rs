//! The symbols of the spherical harmonics, in order.

use super::{Conditional, ShCoding, group};
use crate::{
    GaussianArrays, HexPlaneArrays, SceneFrameArrays,
    adaptive::Damaged,
    entropy::{Distribution, SymbolCoder, gaussian_table},
    executor::LANES,
    planes::bounded_mean,
    sh_rest_coefficients,
};

/// What conditional distributions may depend on: decoded Gaussians without `sh_rest`, the frame, decoded planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions<'a> {
    pub(crate) gaussians: &'a GaussianArrays,
    pub(crate) frame: &'a SceneFrameArrays,
    pub(crate) hexplane: &'a HexPlaneArrays,
}

/// Where distributions come from.
#[derive(Debug)]
pub(crate) enum HarmonicsModel<'a> {
    /// One a channel.
    Tables(Vec<Distribution>),
    /// Networks.
    Conditional(Box<Conditional<'a>>),
}

impl<'a> HarmonicsModel<'a> {
    /// From arrays that are sound.
    pub(crate) fn new(coding: &ShCoding, conditions: Conditions<'a>) -> Self {
        let Conditions { gaussians, frame, hexplane } = conditions;
        match coding {
            ShCoding::Tables { tables, .. } => Self::Tables(tables.iter().map(|table| table.distribution()).collect()),
            ShCoding::Conditional { kind, layers, .. } => {
                Self::Conditional(Box::new(Conditional::new(*kind, layers, gaussians, frame, hexplane)))
            }
        }
    }

    /// The distributions that the tables of [`walk`]'s symbols are numbers of.
    pub(crate) fn distributions(&self) -> &[Distribution] {
        match self {
            Self::Tables(distributions) => distributions,
            Self::Conditional(_) => &gaussian_table().levels,
        }
    }
}

/// Codes `values`, `[count, channels]`, with one coder a degree. An encoder's values become the decoded ones.
pub(crate) fn walk<C: SymbolCoder>(
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
                        let symbol = coder.code(distributions, table as u16, || nearest(*value / step))?;
                        *value = symbol as f32 * step;
                    }
                }
            }
        }
        HarmonicsModel::Conditional(networks) => {
            let table = gaussian_table();
            for first in (0..values.len() / channels).step_by(LANES) {
                for (degree, coder) in (1..).zip(coders.iter_mut()) {
                    let (offset, count) = group(degree);
                    let (scales, means) = networks.parameters(degree, first, values, channels);
                    let rows = values[first * channels..].chunks_exact_mut(channels).take(LANES);
                    for (lane, row) in rows.enumerate() {
                        for (channel, value) in row[offset..offset + count].iter_mut().enumerate() {
                            let mean = bounded_mean(means[channel][lane]);
                            let level = table.level(scales[channel][lane]);
                            let symbol = coder.code(&table.levels, level, || nearest(*value / step - mean))?;
                            *value = (symbol as f32 + mean) * step;
                        }
                    }
                }
            }
        }
    }
    Ok(())
}

/// The nearest integer. Out of range saturates, and is then refused.
fn nearest(value: f32) -> i32 {
    value.round_ties_even() as i32
}
