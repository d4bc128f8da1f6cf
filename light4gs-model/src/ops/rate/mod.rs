//! Operations of the attributes' rate: noise in place of rounding, what attributes are predicted from, bits.

pub mod mixture_bits;
pub mod neighborhoods;
pub mod uniform_noise;
