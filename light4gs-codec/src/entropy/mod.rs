//! Integer distributions and the coder that spends bits by them.
//!
//! Nothing here depends on what a machine's mathematical library returns: tables are made of plain float64
//! additions, multiplications and divisions, or travel in the stream as integers.

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

/// Nanoseconds to read a symbol that takes next to no bits: the level of its scale, its slot, and its value.
pub(crate) const READ_NANOSECONDS: u64 = 80;
/// The largest magnitude of a symbol. Integers up to here are exact in float32.
pub(crate) const SYMBOL_LIMIT: i32 = 1 << 22;
