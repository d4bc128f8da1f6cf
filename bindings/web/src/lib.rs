//! The decoder of `.l4gs` scenes for the browser.
//!
//! Compiled to WebAssembly this is a small set of functions with numbers as arguments and results: bytes in, Gaussians at a
//! time and an order to draw them out. A web worker calls them.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | play scenes in a page | none of this: `dist/light4gs-player.js`, see `docs/player.md` |
//! | put a player into a page that a program writes | [`page`] |
//! | decode and sort in Rust, as the player does | [`OpenScene`], [`Viewpoint`] |
//! | show a file while it comes | [`Arrival`] |
//! | show a take, segment by segment | [`OpenTake`] |
//! | compare decoders by one number | [`digest()`] |
//! | call the decoder from JavaScript of your own | [`abi`] |
//!
//! # Example
//!
//! Nothing here is bound to the browser, so this runs natively too:
//!
//! ```
//! use light4gs_codec::{GaussianArrays, SceneData, encode};
//! use light4gs_web::{ENTRY, OpenScene, Viewpoint};
//!
//! let gaussians = GaussianArrays {
//!     means: vec![[0.0, 0.0, 2.0], [0.0, 0.0, 5.0], [0.0, 0.0, -1.0]],
//!     log_scales: vec![[-3.0; 3]; 3],
//!     quats: vec![[1.0, 0.0, 0.0, 0.0]; 3],
//!     opacity_logits: vec![2.0; 3],
//!     sh_dc: vec![[0.1; 3]; 3],
//!     ..Default::default()
//! };
//! let mut scene = OpenScene::decode(&encode(&SceneData { gaussians, ..Default::default() })?)?;
//!
//! scene.evaluate(0.5, 0, scene.count());
//! // A camera at the origin that looks along z, and sees everything in front of it.
//! let viewpoint = Viewpoint { row: [0.0, 0.0, 1.0, 0.0], eye: [0.0; 3], spread: f32::INFINITY };
//! let list = scene.draw_list(&viewpoint);
//! let depths: Vec<f32> = list.chunks_exact(ENTRY).map(|gaussian| gaussian[2]).collect();
//! assert_eq!(depths[..3], [5.0, 2.0, 0.0]); // back to front; the one behind the camera is left out
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! # Map
//!
//! `player/` has the JavaScript around the decoder, `build` makes the bundle.
//!
//! | file | what |
//! |---|---|
//! | `arrival.rs` | a file that is shown while it comes |
//! | `scene.rs` | a decoded scene, computed at one time after the other |
//! | `take/` | a take, of which the base and some segments are decoded |
//! | `part.rs` | Gaussians that move together: those of a scene, of a base or of a segment |
//! | `levels.rs` | levels of detail: fewer, larger Gaussians that stand for those of a scene |
//! | `gaussians.rs` | activations, and the values for the vertex shader |
//! | `draw_list.rs` | the list for drawing, back to front, with colors |
//! | `limits.rs` | the files that the player takes |
//! | `description.rs` | the contents of a file for the player's panel, as JSON |
//! | `digest.rs` | one number for all bits of a decoded scene |
//! | `abi/` | the functions that JavaScript calls |
//! | `page.rs` | pages around the player, for the program; not in WebAssembly |
pub mod abi;
mod arrival;
mod description;
mod digest;
mod draw_list;
mod gaussians;
mod levels;
mod limits;
#[cfg(not(target_os = "unknown"))]
pub mod page;
mod part;
mod scene;
mod take;

pub use arrival::Arrival;
pub use digest::digest;
pub use draw_list::{ENTRY, ROW, Viewpoint};
pub use limits::{MOST_BYTES, limits, take_limits};
pub use scene::OpenScene;
pub use take::OpenTake;
