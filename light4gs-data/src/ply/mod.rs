//! PLY: point clouds and Gaussians in files that other programs read.
//!
//! Only scalar properties of the `vertex` element are read (ASCII or binary little endian). Other elements, such as cameras
//! or faces, are ignored, before it and after it.

mod gaussians;
mod header;
mod property;
mod table;

pub use gaussians::GaussianPly;
pub use property::{Encoding, Property, Scalar};
pub use table::{VertexTable, read, write};
