//! Images in memory: decoding within a bound, compositing on the background, resizing, and writing as PNG.

mod composite;
mod rgb;
mod store;

pub use composite::{composite, composite_resized};
pub(crate) use rgb::save_png;
pub use rgb::{RgbImage8, RgbImage32};
pub use store::{ImageStore, image_size};
