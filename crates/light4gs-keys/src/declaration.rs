//! The macro `keys!`: from one declaration, a table of the configuration becomes a struct, with its defaults, a list of
//! its keys, and the check of their values.
//!
//! Other crates do parts of this. `confique` and `schematic` know defaults and documentation, `schemars` bounds as
//! well. But none of them has all of: bounds that are checked before values are used, sources, and defaults from
//! another crate; and each would bring crates of its own.

use crate::{Bounds, Problem};

/// A table of the configuration.
pub trait KeyTable {
    /// The description of the table, in lines.
    const ABOUT: &'static [&'static str];
    /// Its entries, in order.
    const ENTRIES: &'static [Entry];

    /// Appends every value that is out of its bounds. `at` is the table's full name with a dot behind it; empty at the top.
    fn problems(&self, at: &str, into: &mut Vec<Problem>);
}

/// A table without keys.
impl KeyTable for () {
    const ABOUT: &'static [&'static str] = &[];
    const ENTRIES: &'static [Entry] = &[];

    fn problems(&self, _: &str, _: &mut Vec<Problem>) {}
}

/// An entry of a table.
#[derive(Clone, Copy, Debug)]
pub enum Entry {
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
pub fn has_no_keys<T: KeyTable>(_: &T) -> bool {
    T::ENTRIES.is_empty()
}

/// Declares a table of the configuration: a struct with its default.
///
/// ```
/// use light4gs_keys::{Bounds, keys};
///
/// keys! {
///     /// The subject of the inner table.
///     pub struct InnerConfig {
///         /// The effect of the key: for rustdoc and for docs/configuration.md.
///         weight: f32 = 0.5; Bounds::Number { least: 0.0, most: 1.0 }, "ours";
///     }
/// }
///
/// keys! {
///     /// The subject of the table.
///     pub struct ExampleConfig {
///         /// A table in the table: its type is declared by `keys!`, too.
///         inner: InnerConfig;
///     }
/// }
/// assert_eq!(ExampleConfig::default().inner.weight, 0.5);
/// ```
///
/// After the default come the key's bounds and the source of the key or of its default. A value that may be absent has
/// `#[serde(with = "optional")]` before its name, where [`optional`](crate::optional) is imported. The entries of a
/// struct with `#[serde(flatten)]` are in this table itself.
#[macro_export]
macro_rules! keys {
    (
        $(#[doc = $about:literal])+
        pub struct $table:ident {
            $(
                $(#[doc = $meaning:literal])+
                $(#[serde $serde:tt])?
                $name:ident: $type:ty $(= $default:expr; $bounds:expr, $source:literal)?;
            )*
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Debug, Clone, PartialEq, $crate::serde::Serialize, $crate::serde::Deserialize)]
        #[serde(default, crate = "light4gs_keys::serde")]
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
                Self { $($name: $crate::default_value!($type $(, $default)?),)* }
            }
        }

        impl $crate::KeyTable for $table {
            const ABOUT: &'static [&'static str] = &[$($about),+];
            const ENTRIES: &'static [$crate::Entry] = &[$(
                $crate::entry!([$($serde)?] [$($meaning),+] $name: $type $(; $bounds, $source)?),
            )*];

            fn problems(&self, at: &str, into: &mut Vec<$crate::Problem>) {
                let _ = (at, &into);
                $($crate::problems!([$($serde)?] self at into $name $(; $bounds)?);)*
            }
        }
    };
}

/// The default of a key; for a table, that of its type.
#[doc(hidden)]
#[macro_export]
macro_rules! default_value {
    ($type:ty) => {
        <$type>::default()
    };
    ($type:ty, $default:expr) => {
        $default
    };
}

/// The entry of a field.
#[doc(hidden)]
#[macro_export]
macro_rules! entry {
    ([(flatten)] $meaning:tt $name:ident: $type:ty) => {
        $crate::Entry::Inlined(<$type as $crate::KeyTable>::ENTRIES)
    };
    ([] $meaning:tt $name:ident: $type:ty) => {
        $crate::Entry::Table {
            name: stringify!($name),
            about: <$type as $crate::KeyTable>::ABOUT,
            entries: <$type as $crate::KeyTable>::ENTRIES,
        }
    };
    ([$($serde:tt)?] $meaning:tt $name:ident: $type:ty; $bounds:expr, $source:literal) => {
        $crate::Entry::Key { name: stringify!($name), bounds: $bounds, meaning: &$meaning, source: $source }
    };
}

/// The check of a field.
#[doc(hidden)]
#[macro_export]
macro_rules! problems {
    ([(flatten)] $self:ident $at:ident $into:ident $name:ident) => {
        $crate::KeyTable::problems(&$self.$name, $at, $into)
    };
    ([] $self:ident $at:ident $into:ident $name:ident) => {
        $crate::KeyTable::problems(&$self.$name, &format!("{}{}.", $at, stringify!($name)), $into)
    };
    ([$($serde:tt)?] $self:ident $at:ident $into:ident $name:ident; $bounds:expr) => {{
        const BOUNDS: $crate::Bounds = $bounds;
        $crate::KeyValue::check(&$self.$name, &BOUNDS, &format!("{}{}", $at, stringify!($name)), $into)
    }};
}
