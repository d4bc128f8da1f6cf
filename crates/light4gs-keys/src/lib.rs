//! Configuration keys, declared once: type, default, bounds, documentation and source.
//!
//! A part of Light4GS that has settings declares them beside itself, with two macros:
//!
//! - [`keys!`] makes a struct of settings. This struct is the table in TOML, and the part is built from it.
//! - [`choice!`] makes an enum of names, among which a key chooses: plain words, or parts with keys of their own.
//!
//! This crate contains no key.
//!
//! # Which of these do I need?
//!
//! | task | use |
//! |---|---|
//! | declare a table of keys | [`keys!`] |
//! | declare a key that chooses by name | [`choice!`] |
//! | bound the values of a key | [`Bounds`], or one of the constants such as [`SHARE`], [`WEIGHT`], [`ITERATIONS`] |
//! | use a type of your own for a key | [`KeyValue`] |
//! | let a key be absent | `Option`, with `#[serde(with = "optional")]`: [`optional`] |
//! | have numbers under names that are not known here | [`ByName`] |
//! | check all values of a table | [`KeyTable::problems`] |
//! | list all keys, or print them as tables of Markdown | [`list`], [`markdown`] |
//! | suggest the nearest name for a mistyped one | [`nearest`], [`UnknownChoice`] |
//!
//! # Example
//!
//! ```
//! use light4gs_keys::{Bounds, KeyTable, choice, keys};
//!
//! choice! {
//!     /// An end of a list.
//!     pub enum End: "end" {
//!         /// The first entry.
//!         First = "first",
//!         /// The last entry.
//!         Last = "last",
//!     }
//! }
//!
//! keys! {
//!     /// The reading of a list.
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
