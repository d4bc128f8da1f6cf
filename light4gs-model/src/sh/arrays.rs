//! Entropy models of the spherical harmonics as the codec's plain arrays.

use light4gs_codec::{CodecError, FrequencyTable, ShCoding};

use super::entropy::ShEntropy;
use super::model::ShEntropyModel;

/// A table goes no further than this many symbols on either side of 0; what lies beyond is escaped.
const TABLE_REACH: i32 = 8000;

/// The symbol of a value, as far as a table reaches.
fn table_symbol(value: f32, step: f32) -> i32 {
    ((value / step).round() as i32).clamp(-TABLE_REACH, TABLE_REACH)
}

impl ShEntropyModel {
    /// What a decoder needs to read `sh_rest`, `[N, 15, 3]` row-major. Tables go as far as these values do.
    ///
    /// # Errors
    /// Values that are not finite, or too many steps apart for a table.
    pub fn to_coding(&self, sh_rest: &[f32]) -> Result<ShCoding, CodecError> {
        let step = self.step();
        if let Some(tables) = self.tables() {
            let symbols = sh_rest.iter().map(|value| table_symbol(*value, step));
            let (low, high) = symbols.fold((0, 0), |(low, high), k| (low.min(k), high.max(k)));
            let pmf = tables.pmf(low..=high);
            let tables = pmf.iter().map(|pmf| FrequencyTable::from_pmf(low, pmf)).collect::<Result<_, _>>()?;
            return Ok(ShCoding::Tables { step, tables });
        }
        Ok(ShCoding::Networks { step, priors: self.priors() })
    }
}

/// Coding of `sh_rest`, `[N, channels]` row-major, without a trained model: a table a channel, from how often each
/// symbol occurs.
///
/// # Errors
/// Values too many steps apart for a table.
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
