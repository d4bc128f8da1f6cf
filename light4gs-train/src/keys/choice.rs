//! Choices by name: enums whose variants have a name in TOML.

/// A name that is none of those a key may have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown {what} `{name}`; the nearest is `{nearest}` (it must be one of {})", known.join(", "))]
pub struct UnknownChoice {
    /// What is chosen.
    pub what: &'static str,
    /// As given.
    pub name: String,
    /// The known name most like it.
    pub nearest: &'static str,
    /// All of them.
    pub known: &'static [&'static str],
}

impl UnknownChoice {
    /// `known` must not be empty.
    pub(crate) fn new(what: &'static str, name: &str, known: &'static [&'static str]) -> Self {
        let nearest = known.iter().min_by_key(|known| strsim::damerau_levenshtein(known, name));
        Self { what, name: name.to_owned(), nearest: nearest.expect("some names are known"), known }
    }
}

/// Declares an enum whose variants have names: `Display` and serde write the name, `FromStr` and serde read it, and a name
/// that is not known is an [`UnknownChoice`] with the nearest one.
macro_rules! choice {
    (
        $(#[$attribute:meta])*
        pub enum $choice:ident: $what:literal {
            $($(#[$variant_attribute:meta])* $variant:ident = $name:expr,)+
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $choice {
            $($(#[$variant_attribute])* #[doc = concat!("\n\nIn TOML: `", $name, "`.")] $variant,)+
        }

        impl $choice {
            /// Every name, in the order of the variants.
            pub const NAMES: &'static [&'static str] = &[$($name),+];

            /// The name in files.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }

        impl std::fmt::Display for $choice {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.pad(self.name())
            }
        }

        impl std::str::FromStr for $choice {
            type Err = $crate::keys::UnknownChoice;

            fn from_str(name: &str) -> Result<Self, Self::Err> {
                $(if name == $name {
                    return Ok(Self::$variant);
                })+
                Err($crate::keys::UnknownChoice::new($what, name, Self::NAMES))
            }
        }

        impl serde::Serialize for $choice {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }

        impl<'de> serde::Deserialize<'de> for $choice {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let name = <String as serde::Deserialize>::deserialize(deserializer)?;
                name.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}

pub(crate) use choice;
