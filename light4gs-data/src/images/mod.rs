//! Images in memory: headers, decoding within a memory bound, undistortion, compositing on the background, resizing, masks
//! and the regions that they mark, and writing as PNG.

mod composite;
mod decode;
mod header;
mod large;
mod mask;
mod reduce;
mod region;
mod resize;
mod rgb;
mod store;
mod undistort;

pub use composite::{composite, composite_resized};
pub use header::image_size;
pub(crate) use header::{ImageHeader, read_headers, turns_sideways};
pub use mask::PixelMask;
pub(crate) use mask::{check_shape, hidden_share, same_shape};
pub use region::{Region, regions};
pub(crate) use rgb::save_png;
pub use rgb::{RgbImage8, RgbImage32};
pub use store::ImageStore;
