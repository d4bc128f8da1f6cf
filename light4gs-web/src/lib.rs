//! The decoder of `.l4gs` scenes for the browser.
//!
//! Compiled to WebAssembly this is a handful of functions that take and give numbers ([`abi`]): bytes in, Gaussians at a
//! time and an order to draw them out. A web worker calls them; `player/` has the JavaScript around it, `build` makes the
//! bundle. Nothing here is bound to the browser, so the tests run natively too.
//!
//! | file | what |
//! |---|---|
//! | `scene.rs` | a decoded scene that is asked for one time after the other |
//! | `gaussians.rs` | activations, and what the vertex shader takes |
//! | `draw_list.rs` | back to front, with the colors that are seen |
//! | `description.rs` | what the panel of the player shows, as JSON |
//! | `digest.rs` | one number for all bits of a decoded scene |
//! | `abi.rs` | the functions that JavaScript calls |
//! | `page.rs` | pages around the player, for the program; not in WebAssembly |

pub mod abi;
mod description;
mod digest;
mod draw_list;
mod gaussians;
#[cfg(not(target_arch = "wasm32"))]
pub mod page;
mod scene;

pub use digest::digest;
pub use draw_list::{ENTRY, ROW, Viewpoint};
pub use scene::OpenScene;
