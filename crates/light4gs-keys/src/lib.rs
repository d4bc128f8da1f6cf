//! Configuration keys, declared once: type, default, bounds, documentation and source.
//!
//! - `declaration`: the macro `keys!`, which makes a struct and its table of keys from one declaration
//! - `bounds`: the values that a key may have
//! - `choice`: words, declared as enums
//! - `kinds`: parts of the training that are chosen by name, each with its own keys
//! - `optional`: values that may be absent, although TOML has no null
//! - `reference`: what follows from the declarations: the list of all keys, `configs/base.toml`, and the tables of
//!   `docs/configuration.md`
//!
//! This room contains no key. The declarations are near the code that they configure, and `config` collects them.

mod bounds;
mod choice;
mod declaration;
mod kinds;
pub(crate) mod optional;
mod reference;

pub use bounds::Bounds;
pub(crate) use bounds::{
    DECIBELS, INTERVAL, ITERATION, ITERATIONS, MOST_GAUSSIANS, MOST_INTEGER, RATE, SHARE, STEP, THRESHOLD, WEIGHT,
};
pub use choice::UnknownChoice;
pub(crate) use choice::{choice, named, nearest, serde_by_name};
pub(crate) use declaration::has_no_keys;
pub(crate) use declaration::{Entry, KeyTable, default_value, entry, keys};
pub(crate) use kinds::kinds;
pub use reference::Key;
pub(crate) use reference::{list, markdown, toml_text};
