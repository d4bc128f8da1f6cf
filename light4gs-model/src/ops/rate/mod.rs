//! Operations of the attributes' rate: noise in place of rounding, rows of attributes and their neighbors, bits.

pub mod gather_rows;
pub mod mixture_bits;
pub mod uniform_noise;
