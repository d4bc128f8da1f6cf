//! Custom operations against the plain ones that they stand for.

mod attribute_bits;
mod columns;
mod deformation_network;
mod density_likelihood;
mod image_difference;
mod linear;
mod neighborhoods;
mod plane_query;
