//! The feature planes in a stream: as float32, or entropy coded with a context model (paper III-C, docs/design.md).
//!
//! Encoder and decoder visit the planes by the same function, and evaluate the same networks for every value's
//! distribution. They differ only in the [`SymbolCoder`](crate::entropy::SymbolCoder) that they pass to it.
//!
//! | file | what |
//! |---|---|
//! | `head.rs`, `explicit.rs` | which planes there are, and their sizes; planes as float32 |
//! | `coding.rs` | how planes are coded, as data |
//! | `context_model.rs`, `context_section.rs` | the context model as data, and as bytes |
//! | `plan.rs` | the order in which planes are coded |
//! | `exact_model.rs` | the context model, prepared for running |
//! | `cost.rs` | the cost of reading planes, known beforehand |
//! | `plane_parameters.rs` | scales and means of a row |
//! | `walk.rs` | the symbols of one plane, in order |
//! | `coder.rs`, `section.rs` | all planes: encode, decode; their bytes |
//! | `summary.rs` | what a stream says of its planes besides their values |

mod coder;
mod coding;
mod context_model;
pub(crate) mod context_section;
mod cost;
mod exact_model;
pub(crate) mod explicit;
pub(crate) mod head;
mod plan;
mod plane_parameters;
pub(crate) mod section;
mod summary;
mod walk;

pub(crate) use coder::parameters;
pub use coding::PlaneCoding;
pub use context_model::{Condition, ContextModelArrays, LatentArrays, PlanePrior, PlaneSource};
pub(crate) use plane_parameters::bounded_mean;
pub(crate) use summary::Summary;
pub(crate) use walk::nearest;
