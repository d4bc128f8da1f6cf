//! How the Gaussians move: the bytes of its description, and where the Gaussians are at a time.
//!
//! What moves them is data of the scene: `scene/motion.rs`.

mod evaluator;
pub(crate) mod query;
pub(crate) mod section;

pub use evaluator::MotionEvaluator;
