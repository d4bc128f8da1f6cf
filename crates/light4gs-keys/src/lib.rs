//! Configuration keys, declared once: type, default, bounds, documentation and source.
//!
//! A part of Light4GS that has settings declares them beside itself, with two macros:
//!
//! - [`keys!`] makes a struct of settings. This struct is the table in TOML, and it is what the part is built from.
//! - [`choice!`] makes an enum of names, among which a key chooses: plain words, or parts with keys of their own.
//!
//! What follows from the declarations: the values that a key may have ([`Bounds`]), checked on the typed values
//! ([`KeyTable::problems`]), the list of all keys ([`list`]), and the tables of `docs/configuration.md` ([`markdown`]).
//! This crate contains no key.
//!
//! ```
//! use light4gs_keys::{Bounds, KeyTable, choice, keys};
//!
//! choice! {
//!     /// Which end of a list is taken.
//!     pub enum End: "end" {
//!         /// The first entry.
//!         First = "first",
//!         /// The last entry.
//!         Last = "last",
//!     }
//! }
//!
//! keys! {
//!     /// How a list is read.
//!     pub struct ListConfig {
//!         /// The end at which reading begins.
//!         end: End = End::First; End::BOUNDS, "ours";
//!         /// Share of the list that is read.
//!         share: f32 = 0.5; Bounds::Number { least: 0.0, most: 1.0 }, "ours";
//!     }
//! }
//!
//! assert_eq!("last".parse(), Ok(End::Last));
//! let mut problems = Vec::new();
//! ListConfig { share: 2.0, ..ListConfig::default() }.problems("list.", &mut problems);
//! assert_eq!(problems[0].key, "list.share");
//! assert_eq!(problems[0].message, "is 2; it must be 0 to 1");
//! ```

mod bounds;
mod by_name;
mod choice;
mod declaration;
mod names;
pub mod optional;
mod reference;
mod value;

// The name by which the macros' serde attributes find this crate, also in its own tests.
extern crate self as light4gs_keys;

#[doc(hidden)]
pub use choice::meaning;
#[doc(hidden)]
pub use serde;

pub use bounds::{Bounds, DECIBELS, INTERVAL, ITERATION, ITERATIONS, MOST_INTEGER, RATE, SHARE, THRESHOLD, WEIGHT};
pub use by_name::ByName;
pub use declaration::{Entry, KeyTable, has_no_keys};
pub use names::{Choices, UnknownChoice, nearest};
pub use reference::{Key, list, markdown};
pub use value::{KeyValue, Problem};
