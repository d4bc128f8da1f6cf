//! Splatting of Gaussians on plain slices: projection, tiles, blending, and the derivative. Every sum has a fixed order, so
//! that nothing depends on the number of threads.

mod blend;
mod project;
mod rasterize;
mod rasterize_backward;
mod significance;
mod tiles;

pub use project::{GaussianSlices, INVALID_RADIUS};
pub use rasterize::{CHANNELS, TilePixels, assemble, rasterize};
pub use rasterize_backward::{GaussianGradients, splat_backward};
pub use significance::{SCORES, significance};
pub use tiles::TileLists;
