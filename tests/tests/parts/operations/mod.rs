//! Custom operations against the plain ones that they stand for.

mod gather_rows;
mod linear;
mod mixture_bits;
