//! Gaussians in files for other players: glTF with the Khronos extension, the 4dgs container, a zip of PLY files.
//!
//! | file | what |
//! |---|---|
//! | `glb` | a glTF file: Gaussians as points with attributes, and the file around them |
//! | `skin` | their motion, as joints and weights |
//! | `accessors` | the numbers of a glTF file |
//! | `four_dgs` | the 4dgs container |
//! | `ply_zip` | a zip archive with a PLY file for each time |
//! | `conventions` | quaternions and colors as others have them |

mod accessors;
mod conventions;
mod four_dgs;
mod glb;
mod ply_zip;
mod skin;

pub use four_dgs::{MotionSample, write_four_dgs};
pub use glb::{GlbOptions, glb_bytes, write_glb};
pub use ply_zip::write_ply_zip;
pub use skin::{Influence, Joint, JointPose, Skin};
