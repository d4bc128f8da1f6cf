//! Gaussians in files for other players: glTF with the Khronos extension, and the 4dgs container.

mod four_dgs;
mod glb;

pub use four_dgs::{MotionSample, write_four_dgs};
pub use glb::{GlbOptions, glb_bytes, write_glb};
