//! The macro `kinds!`: parts of the training that the configuration chooses by name.

/// Declares the built-in kinds of a part: an enum of their names, as `choice!` makes it, and a struct with the keys of each.
///
/// ```ignore
/// kinds! {
///     /// What is chosen among.
///     pub enum PartKind: "part" {
///         First = first: FirstPart,
///         Second = second: SecondPart,
///     }
///     /// The keys of all kinds.
///     pub struct PartKinds: dyn Part;
/// }
/// ```
///
/// The types are declared by `keys!`, and each implements `Part`. The keys of a kind are in a table of its name, beside
/// the key that chooses the kind.
macro_rules! kinds {
    (
        $(#[$attribute:meta])*
        pub enum $kind:ident: $what:literal {
            $($variant:ident = $name:ident: $type:ty,)+
        }
        $(#[$tables_attribute:meta])*
        pub struct $tables:ident: dyn $part:path;
    ) => {
        $crate::keys::choice! {
            $(#[$attribute])*
            pub enum $kind: $what {
                $(#[doc = concat!("[`", stringify!($type), "`]")] $variant = stringify!($name),)+
            }
        }

        $(#[$tables_attribute])*
        #[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default)]
        pub struct $tables {
            $(
                #[doc = concat!("The keys of [`", stringify!($type), "`].")]
                #[serde(skip_serializing_if = "crate::keys::has_no_keys")]
                pub $name: $type,
            )+
        }

        impl $tables {
            /// The kind with a name, with its keys.
            pub fn of(&self, kind: $kind) -> Box<dyn $part> {
                match kind {
                    $($kind::$variant => Box::new(self.$name.clone()),)+
                }
            }
        }

        impl $crate::keys::KeyTable for $tables {
            const ABOUT: &'static [&'static str] = &[];
            const ENTRIES: &'static [$crate::keys::Entry] = &[$($crate::keys::entry!([] [] $name: $type),)+];
        }
    };
}

pub(crate) use kinds;
