//! A learned distribution of integers, as it is stored in the stream.

use std::convert::Infallible;

use super::{Distribution, SYMBOL_LIMIT, TOTAL_BITS};
use crate::{
    CodecError,
    adaptive::{AdaptiveInteger, BitCoder, BitDecoder, BitEncoder, Damaged},
    budget::Budget,
};

/// Probability 1 in units of the weights.
const ONE: f64 = 65_536.0;
/// The largest code: a weight of 65536.
const MOST_CODE: i32 = 112;
/// Symbols of a table.
const MOST_SYMBOLS: usize = 1 << 14;
/// Bytes of a symbol in a table and in its [`Distribution`], and nanoseconds to read it and to place it.
const SYMBOL_BYTES: u64 = 8;
const SYMBOL_NANOSECONDS: u64 = 60;
/// The cost of a table besides its symbols, in symbols.
const SYMBOLS_OF_A_TABLE: u64 = 100;
/// Probability that is cut off on either side and left to the escape, since listing those symbols takes more bytes than
/// it saves.
const CUT: f64 = 1.0 / 8192.0;

/// Frequencies of a run of integers, and of the escape, which stands for all others.
///
/// A frequency is kept as a floating-point number of one byte, four significant bits and an exponent. It is within 7 %
/// and takes a few bits in the stream; a symbol takes less than a thousandth of a bit more. The frequencies of the
/// coder follow from these by integer arithmetic alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrequencyTable {
    first: i32,
    /// One code a symbol, then the escape's.
    codes: Vec<u8>,
}

impl FrequencyTable {
    /// The table of a distribution: `pmf[i]` is the probability of `first + i`. The escape gets the far ends of the
    /// distribution, and `1 - sum(pmf)`.
    ///
    /// ```
    /// use light4gs_codec::FrequencyTable;
    /// let table = FrequencyTable::from_pmf(-1, &[0.25, 0.5, 0.25])?;
    /// assert!((table.bits(0) - 1.0).abs() < 0.01 && (table.bits(-1) - 2.0).abs() < 0.01);
    /// # Ok::<(), light4gs_codec::CodecError>(())
    /// ```
    ///
    /// # Errors
    /// No symbols, more than 2^14 after the far ends are cut off, symbols beyond ±2^22, a probability that is negative
    /// or not finite, a sum above 1.001.
    pub fn from_pmf(first: i32, pmf: &[f64]) -> Result<Self, CodecError> {
        let invalid = |field: &str, found: String, expected: &str| {
            Err(CodecError::invalid("frequency table", field, found, expected))
        };
        if let Some(bad) = pmf.iter().find(|p| !(p.is_finite() && **p >= 0.0)) {
            return invalid("probability", bad.to_string(), "0 or more");
        }
        let sum: f64 = pmf.iter().sum();
        if pmf.is_empty() || sum > 1.001 {
            return invalid("sum of probabilities", sum.to_string(), "of one symbol or more, and at most 1");
        }
        let kept = pmf.len().saturating_sub(cut(pmf.iter().rev())).max(1);
        let skipped = cut(pmf[..kept].iter()).min(kept - 1);
        let pmf = &pmf[skipped..kept];
        let start = i64::from(first) + skipped as i64;
        let limit = i64::from(SYMBOL_LIMIT);
        if start < -limit || start + pmf.len() as i64 > limit || pmf.len() > MOST_SYMBOLS {
            return invalid("symbols", format!("{} from {start}", pmf.len()), "at most 16384, within ±4194304");
        }
        let escape = (1.0 - pmf.iter().sum::<f64>()).max(0.0);
        let codes = pmf.iter().chain([&escape]).map(|&probability| code_of(probability)).collect();
        Ok(Self { first: start as i32, codes })
    }

    /// The bits of a symbol, without the digits that follow an escape.
    pub fn bits(&self, symbol: i32) -> f64 {
        self.distribution().bits(symbol)
    }

    /// Slot `i` begins at `i + floor(W · (2^24 - slots) / S)`, where `W` is the sum of the weights before it and `S`
    /// that of all.
    pub(crate) fn distribution(&self) -> Distribution {
        let slots = self.codes.len() as u64;
        let total: u64 = self.codes.iter().map(|&code| weight_of(code)).sum();
        let mut before = 0;
        let starts = (0..slots).zip(&self.codes).map(|(slot, &code)| {
            let start = slot + before * ((1 << TOTAL_BITS) - slots) / total;
            before += weight_of(code);
            start as u32
        });
        Distribution::new(self.first, starts.collect())
    }
}

/// How many of the first probabilities can be left to the escape.
fn cut<'a>(pmf: impl Iterator<Item = &'a f64>) -> usize {
    let mut mass = 0.0;
    pmf.take_while(|&&probability| {
        mass += probability;
        mass <= CUT
    })
    .count()
}

/// Codes below 8 are weights themselves; above, three bits follow a leading one: code `8 (e + 1) + m` is `(8 + m) 2^e`.
fn weight_of(code: u8) -> u64 {
    let code = u64::from(code);
    if code < 8 { code } else { (8 + code % 8) << (code / 8 - 1) }
}

/// The code whose weight is nearest, at least 1.
fn code_of(probability: f64) -> u8 {
    let wanted = probability.min(1.0) * ONE;
    let above = (1..MOST_CODE as u8).find(|&code| weight_of(code) as f64 >= wanted).unwrap_or(MOST_CODE as u8);
    let below = (above - 1).max(1);
    if wanted - (weight_of(below) as f64) < weight_of(above) as f64 - wanted { below } else { above }
}

/// Appends tables, whose number the reader must know.
pub(crate) fn write_tables(tables: &[FrequencyTable]) -> Vec<u8> {
    let mut encoder = BitEncoder::default();
    let mut tables = tables.to_vec();
    match code_tables(&mut encoder, &mut tables, |_| Ok::<_, Infallible>(())) {
        Ok(Ok(())) => encoder.finish(),
        Ok(Err(Damaged)) => unreachable!("an encoder does not run out of bytes"),
    }
}

/// Reads `count` tables; messages name `field`. A table may have many symbols, though it takes few bytes.
pub(crate) fn read_tables(
    section: &'static str,
    field: &'static str,
    bytes: &[u8],
    count: usize,
    budget: &Budget,
) -> Result<Vec<FrequencyTable>, CodecError> {
    budget.stream(section, bytes.len())?;
    let mut tables = vec![FrequencyTable { first: 0, codes: Vec::new() }; count];
    let ask = |symbols: u64| budget.things(section, symbols + SYMBOLS_OF_A_TABLE, SYMBOL_BYTES, SYMBOL_NANOSECONDS);
    match code_tables(&mut BitDecoder::new(bytes), &mut tables, ask)? {
        Ok(()) => Ok(tables),
        Err(Damaged) => Err(CodecError::invalid(section, field, "damaged", "frequency tables")),
    }
}

/// Codes the first symbol and the number of symbols of each table, then the codes, each as the difference from the one
/// before (the first from 0).
///
/// `ask` is called with the number of symbols of each table before memory is taken for them.
fn code_tables<E>(
    coder: &mut impl BitCoder,
    tables: &mut [FrequencyTable],
    ask: impl Fn(u64) -> Result<(), E>,
) -> Result<Result<(), Damaged>, E> {
    let mut ends = AdaptiveInteger::new(2);
    let mut differences = AdaptiveInteger::new(3);
    for FrequencyTable { first, codes } in tables {
        if let Err(damaged) = coder.check() {
            return Ok(Err(damaged));
        }
        *first = ends.code(coder, 0, *first);
        let symbols = ends.code(coder, 1, codes.len() as i32 - 1);
        if first.unsigned_abs() > SYMBOL_LIMIT as u32 || !(1..=MOST_SYMBOLS as i32).contains(&symbols) {
            return Ok(Err(Damaged));
        }
        ask(symbols as u64)?;
        codes.resize(symbols as usize + 1, 0);
        let (mut last, mut context) = (0, 0);
        for code in codes {
            let difference = differences.code(coder, context, i32::from(*code) - last);
            last = last.wrapping_add(difference);
            if !(1..=MOST_CODE).contains(&last) {
                return Ok(Err(Damaged));
            }
            *code = last as u8;
            context = if difference < 0 { 1 } else { 2 };
        }
    }
    Ok(coder.check())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Limits;

    #[test]
    fn weights_rise_and_are_near() {
        let weights: Vec<_> = (1..=MOST_CODE as u8).map(weight_of).collect();
        assert!(weights.is_sorted_by(|a, b| a < b));
        assert_eq!((weights[0], *weights.last().unwrap()), (1, 65_536));
        for i in 0..=1000 {
            let p = f64::from(i) / 1000.0;
            let weight = weight_of(code_of(p)) as f64 / ONE;
            assert!((weight - p).abs() <= 0.07 * p + 1.0 / ONE, "{p}: {weight}");
        }
    }

    #[test]
    fn far_ends_go_to_the_escape() {
        let laplace: Vec<f64> = (-300..=300i32).map(|k| 0.2 * 0.6667f64.powi(k.abs())).collect();
        let table = FrequencyTable::from_pmf(-300, &laplace).unwrap();
        assert!(table.codes.len() < 50 && table.first > -25, "{table:?}");
        assert!((table.bits(0) - 5f64.log2()).abs() < 0.1);
        assert!(table.bits(300) < 14.0);
        let certain = FrequencyTable::from_pmf(-2, &[0.0, 0.0, 1.0, 0.0]).unwrap();
        assert_eq!((certain.first, certain.codes.len()), (0, 2));
        assert!(certain.bits(0) < 3e-5);
    }

    #[test]
    fn nonsense_is_refused() {
        for pmf in [&[][..], &[0.7, 0.7], &[-0.1, 0.5], &[f64::NAN], &[f64::INFINITY]] {
            assert!(FrequencyTable::from_pmf(0, pmf).is_err());
        }
        assert!(FrequencyTable::from_pmf(i32::MAX, &[1.0]).is_err());
        assert!(FrequencyTable::from_pmf(i32::MIN, &[1.0]).is_err());
        assert!(FrequencyTable::from_pmf(0, &[0.0; 5]).is_ok());
    }

    proptest! {
        #[test]
        fn tables_come_back(pmfs in prop::collection::vec(
            (-1000i32..1000, prop::collection::vec(0.0f64..1.0, 1..60)), 0..5))
        {
            let tables: Vec<_> = pmfs
                .into_iter()
                .map(|(first, pmf)| {
                    let sum: f64 = pmf.iter().sum::<f64>() + 0.01;
                    FrequencyTable::from_pmf(first, &pmf.iter().map(|p| p / sum).collect::<Vec<_>>()).unwrap()
                })
                .collect();
            let bytes = write_tables(&tables);
            prop_assert_eq!(read_tables("t", "t", &bytes, tables.len(), &Budget::new(&Limits::default())).unwrap(), tables);
        }

        #[test]
        fn any_bytes_give_tables_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
            if let Ok(tables) = read_tables("t", "t", &bytes, 3, &Budget::new(&Limits::default())) {
                tables.iter().for_each(|table| drop(table.distribution()));
            }
        }
    }
}
