//! A program outside the workspace that depends on Burn with its default features and on `light4gs-model` by path.
//!
//! It is the example `ten_steps` of that crate, built as a stranger would build it.

include!("../../../light4gs-model/examples/ten_steps.rs");
