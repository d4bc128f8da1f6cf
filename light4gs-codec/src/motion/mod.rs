//! How the Gaussians move: the bytes of the motion's description, and the Gaussians at a time.
//!
//! The motion as data of a scene is in `scene/motion.rs`.

mod evaluator;
pub(crate) mod query;
pub(crate) mod section;

pub use evaluator::MotionEvaluator;
