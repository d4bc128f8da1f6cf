//! Custom operations against the plain ones that they stand for.

mod columns;
mod neighborhoods;
mod image_difference;
mod linear;
mod mixture_bits;
