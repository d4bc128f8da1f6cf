//! Gaussians in files for other players: glTF with the Khronos extension, and the 4dgs container.
//!
//! | file | what |
//! |---|---|
//! | `glb` | a glTF file: Gaussians as points with attributes, and the file around them |
//! | `skin` | their motion, as joints and weights |
//! | `accessors` | the numbers of a glTF file |
//! | `four_dgs` | the 4dgs container |
//! | `conventions` | quaternions and colors as others have them |

mod accessors;
mod conventions;
mod four_dgs;
mod glb;
mod skin;

pub use four_dgs::{MotionSample, write_four_dgs};
pub use glb::{GlbOptions, glb_bytes, write_glb};
pub use skin::{Influence, Joint, JointPose, Skin};
