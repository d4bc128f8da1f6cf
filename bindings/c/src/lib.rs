//! Functions for C and for all that can call it: reads `.l4gs` files and draws them on the CPU.
//!
//! `include/light4gs.h` is made from these sources by cbindgen, with `cbindgen.toml`; `docs/bindings.md` has an example.
//!
//! | file | what |
//! |---|---|
//! | `functions.rs` | the functions |
//! | `types.rs` | the structures that they take and fill |
//! | `scene.rs` | the open scene |
//! | `failure.rs` | status, message and kind of an error; panics end here |

mod failure;
mod functions;
mod scene;
mod types;

pub use failure::L4gsStatus;
pub use functions::*;
pub use scene::L4gsScene;
pub use types::*;
