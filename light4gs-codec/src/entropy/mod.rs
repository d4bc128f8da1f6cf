//! Integer distributions and the entropy coder that uses them.
//!
//! Nothing here depends on a machine's mathematical library: tables are computed by plain float64 additions,
//! multiplications and divisions, or stand in the stream as integers.

mod distribution;
mod frequency_table;
mod gaussian_table;
mod normal;
mod symbol_coder;

pub use distribution::Distributions;
pub(crate) use distribution::{Distribution, TOTAL_BITS};
pub use frequency_table::FrequencyTable;
pub(crate) use frequency_table::{read_tables, write_tables};
pub(crate) use gaussian_table::gaussian_table;
pub(crate) use symbol_coder::{SymbolCoder, SymbolReader, SymbolWriter};

/// Nanoseconds to read a symbol, however few bits it takes: the level of its scale, its slot, and its value.
pub(crate) const READ_NANOSECONDS: u64 = 80;
/// The largest magnitude of a symbol. Integers up to here are exact in float32.
pub(crate) const SYMBOL_LIMIT: i32 = 1 << 22;
