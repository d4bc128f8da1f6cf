//! The decoder of `.l4gs` scenes for the browser.
//!
//! Compiled to WebAssembly this is a handful of functions that take and give numbers ([`abi`]): bytes in, Gaussians at a
//! time and an order to draw them out. A web worker calls them; `player/` has the JavaScript around it, `build` makes the
//! bundle. Nothing here is bound to the browser, so the tests run natively too.
//!
//! | file | what |
//! |---|---|
//! | `arrival.rs` | a file that is shown while it comes |
//! | `scene.rs` | a decoded scene, of which one time after the other is computed |
//! | `levels.rs` | levels of detail: fewer, larger Gaussians in place of those of a scene |
//! | `gaussians.rs` | activations, and the values for the vertex shader |
//! | `draw_list.rs` | the list for drawing, back to front, with colors |
//! | `description.rs` | the contents of a file for the player's panel, as JSON |
//! | `digest.rs` | one number for all bits of a decoded scene |
//! | `abi.rs` | the functions that JavaScript calls |
//! | `page.rs` | pages around the player, for the program; not in WebAssembly |

pub mod abi;
mod arrival;
mod description;
mod digest;
mod draw_list;
mod gaussians;
mod levels;
#[cfg(not(target_os = "unknown"))]
pub mod page;
mod scene;

pub use arrival::Arrival;
pub use digest::digest;
pub use draw_list::{ENTRY, ROW, Viewpoint};
pub use scene::OpenScene;
