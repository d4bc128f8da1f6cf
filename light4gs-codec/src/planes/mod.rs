//! Entropy coding of the hexplanes under a context model (paper III-C, DESIGN sections 6 and 7).
//!
//! Encoder and decoder run the same walk over the planes and ask the same networks for every value's distribution; they
//! differ only in the [`SymbolCoder`](crate::entropy::SymbolCoder) that they hand to it.
//!
//! | file | what |
//! |---|---|
//! | `plan.rs` | what each plane is coded from, and when |
//! | `exact_model.rs` | the context model, ready for the exact executor |
//! | `plane_parameters.rs` | scales and means of a row |
//! | `walk.rs` | the symbols of one plane, in order |
//! | `coder.rs` | all planes: encode, decode |

mod coder;
mod exact_model;
mod plan;
mod plane_parameters;
mod walk;

pub(crate) use coder::{CodedPlanes, decode, encode, parameters, stream_order};
pub(crate) use plan::{PlanePlan, plan};
pub(crate) use plane_parameters::bounded_mean;
