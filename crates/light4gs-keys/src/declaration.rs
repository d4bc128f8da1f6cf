//! The macro `keys!`: from one declaration, a table of the configuration becomes a struct, with its defaults and a list
//! of its keys.
//!
//! Other crates do parts of this. `confique` and `schematic` know defaults and documentation, `schemars` bounds as
//! well. But none of them has all of: bounds that are checked before values are used, sources, and defaults from
//! another crate; and each would bring crates of its own.

use super::Bounds;

/// A table of the configuration.
pub(crate) trait KeyTable {
    /// The description of the table, in lines.
    const ABOUT: &'static [&'static str];
    /// Its entries, in order.
    const ENTRIES: &'static [Entry];
}

/// An entry of a table.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Entry {
    /// A key.
    Key {
        /// Its name, without the tables around it.
        name: &'static str,
        /// The values that it may have.
        bounds: Bounds,
        /// Its documentation, in lines.
        meaning: &'static [&'static str],
        /// The source of the key or of its default.
        source: &'static str,
        /// A short note beside it in `configs/base.toml`.
        note: Option<&'static str>,
    },
    /// A table in the table.
    Table {
        /// Its name, without the tables around it.
        name: &'static str,
        /// [`KeyTable::ABOUT`]
        about: &'static [&'static str],
        /// [`KeyTable::ENTRIES`]
        entries: &'static [Entry],
    },
    /// The entries of another struct, which are in this table as if they were its own.
    Inlined(&'static [Entry]),
}

/// Whether a table has no keys and is therefore not written.
pub(crate) fn has_no_keys<T: KeyTable>(_: &T) -> bool {
    T::ENTRIES.is_empty()
}

/// Declares a table of the configuration.
///
/// ```ignore
/// keys! {
///     /// What the table is about.
///     pub struct ExampleConfig {
///         /// What the key does: for rustdoc and for docs/configuration.md.
///         weight: f32 = 0.5; Bounds::Number { least: 0.0, most: 1.0 }, "ours", "a note for configs/base.toml";
///         /// A table in the table: its type is declared by `keys!`, too.
///         inner: InnerConfig;
///     }
/// }
/// ```
///
/// The note may be left out. A value that may be absent has `#[serde(with = "optional")]` before its name. The entries
/// of a struct with `#[serde(flatten)]` are in this table itself.
macro_rules! keys {
    (
        $(#[doc = $about:literal])+
        pub struct $table:ident {
            $(
                $(#[doc = $meaning:literal])+
                $(#[serde $serde:tt])?
                $name:ident: $type:ty $(= $default:expr; $bounds:expr, $source:literal $(, $note:literal)?)?;
            )*
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default)]
        pub struct $table {
            $(
                $(#[doc = $meaning])+
                $(#[doc = concat!("\n\nSource: ", $source, ".")])?
                $(#[serde $serde])?
                pub $name: $type,
            )*
        }

        impl Default for $table {
            fn default() -> Self {
                Self { $($name: $crate::keys::default_value!($type $(, $default)?),)* }
            }
        }

        impl $crate::keys::KeyTable for $table {
            const ABOUT: &'static [&'static str] = &[$($about),+];
            const ENTRIES: &'static [$crate::keys::Entry] = &[$(
                $crate::keys::entry!(
                    [$($serde)?] [$($meaning),+] $name: $type $(; $bounds, $source $(, $note)?)?
                ),
            )*];
        }
    };
}

/// The default of a key; for a table, that of its type.
macro_rules! default_value {
    ($type:ty) => {
        <$type>::default()
    };
    ($type:ty, $default:expr) => {
        $default
    };
}

/// The entry of a field.
macro_rules! entry {
    ([(flatten)] $meaning:tt $name:ident: $type:ty) => {
        $crate::keys::Entry::Inlined(<$type as $crate::keys::KeyTable>::ENTRIES)
    };
    ([] $meaning:tt $name:ident: $type:ty) => {
        $crate::keys::Entry::Table {
            name: stringify!($name),
            about: <$type as $crate::keys::KeyTable>::ABOUT,
            entries: <$type as $crate::keys::KeyTable>::ENTRIES,
        }
    };
    ([$($serde:tt)?] $meaning:tt $name:ident: $type:ty; $bounds:expr, $source:literal) => {
        $crate::keys::entry!(@key $name, $meaning, $bounds, $source, None)
    };
    ([$($serde:tt)?] $meaning:tt $name:ident: $type:ty; $bounds:expr, $source:literal, $note:literal) => {
        $crate::keys::entry!(@key $name, $meaning, $bounds, $source, Some($note))
    };
    (@key $name:ident, $meaning:tt, $bounds:expr, $source:literal, $note:expr) => {
        $crate::keys::Entry::Key {
            name: stringify!($name),
            bounds: $bounds,
            meaning: &$meaning,
            source: $source,
            note: $note,
        }
    };
}

pub(crate) use {default_value, entry, keys};
