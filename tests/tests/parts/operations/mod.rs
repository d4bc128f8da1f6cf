//! Custom operations against the plain ones that they stand for.

mod columns;
mod deformation_network;
mod density_likelihood;
mod image_difference;
mod linear;
mod mixture_bits;
mod neighborhoods;
mod plane_query;
