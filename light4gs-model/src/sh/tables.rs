//! Frequency tables of the spherical harmonics for the codec.

use std::ops::RangeInclusive;

use light4gs_codec::{CodecError, FrequencyTable, ShCoding};

/// A table has at most this many symbols on either side of 0; others are escaped.
const TABLE_REACH: i32 = 8000;

/// The symbol of a value, clamped to the reach of a table.
fn table_symbol(value: f32, step: f32) -> i32 {
    ((value / step).round() as i32).clamp(-TABLE_REACH, TABLE_REACH)
}

/// Coding of `sh_rest`, `[N, 15, 3]` row-major, with a table for each channel that extends as far as these values.
/// `pmf` gives each channel's probabilities of a range of symbols.
///
/// # Errors
/// Values that are not finite, or that span too many steps for a table.
pub(super) fn table_coding(
    sh_rest: &[f32],
    step: f32,
    pmf: impl FnOnce(RangeInclusive<i32>) -> Vec<Vec<f64>>,
) -> Result<ShCoding, CodecError> {
    let symbols = sh_rest.iter().map(|value| table_symbol(*value, step));
    let (low, high) = symbols.fold((0, 0), |(low, high), k| (low.min(k), high.max(k)));
    let tables = pmf(low..=high).iter().map(|pmf| FrequencyTable::from_pmf(low, pmf)).collect::<Result<_, _>>()?;
    Ok(ShCoding::Tables { step, tables })
}

/// Coding of `sh_rest`, `[N, channels]` row-major, without a trained model: a table for each channel, from the
/// frequencies of its symbols.
///
/// # Errors
/// Values that span too many steps for a table.
pub fn counted_sh_coding(sh_rest: &[f32], channels: usize, step: f32) -> Result<ShCoding, CodecError> {
    let table = |channel: usize| {
        let symbols: Vec<i32> =
            sh_rest.iter().skip(channel).step_by(channels).map(|value| table_symbol(*value, step)).collect();
        let (low, high) = symbols.iter().fold((0, 0), |(low, high), k| (low.min(*k), high.max(*k)));
        let mut pmf = vec![0.0; (high - low + 1) as usize];
        for symbol in &symbols {
            pmf[(symbol - low) as usize] += 1.0 / symbols.len() as f64;
        }
        if symbols.is_empty() {
            pmf[0] = 1.0;
        }
        FrequencyTable::from_pmf(low, &pmf)
    };
    Ok(ShCoding::Tables { step, tables: (0..channels).map(table).collect::<Result<_, _>>()? })
}
