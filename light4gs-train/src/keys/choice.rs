//! Choices by name: enums whose variants have a name in TOML.

/// A name that is none of the accepted ones.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown {what} `{name}`; the nearest is `{nearest}` (it must be one of {})", known.join(", "))]
pub struct UnknownChoice {
    /// The thing that is chosen.
    pub what: &'static str,
    /// The given name.
    pub name: String,
    /// The most similar accepted name.
    pub nearest: &'static str,
    /// All accepted names.
    pub known: &'static [&'static str],
}

impl UnknownChoice {
    /// `known` must not be empty.
    pub fn new(what: &'static str, name: &str, known: &'static [&'static str]) -> Self {
        let nearest = nearest(known.iter().copied(), name).expect("some names are known");
        Self { what, name: name.to_owned(), nearest, known }
    }
}

/// The most similar of the known names: one that begins with the name if there is one.
pub(crate) fn nearest<'a>(known: impl IntoIterator<Item = &'a str>, name: &str) -> Option<&'a str> {
    let difference = |known: &&str| (!known.starts_with(name), strsim::damerau_levenshtein(known, name));
    known.into_iter().min_by_key(difference)
}

/// Declares an enum whose variants have names: `Display` and serde write the name, `FromStr` and serde read it. An
/// unknown name is an [`UnknownChoice`] with the nearest one.
#[macro_export]
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

        $crate::serde_by_name!($choice);
    };
}

/// Gives `Display`, `FromStr` and serde, as [`choice`] does, to an enum that another crate declares with `NAMES`,
/// `name` and `by_name`.
macro_rules! named {
    ($(#[$attribute:meta])* pub struct $named:ident(pub $kind:ty): $what:literal;) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct $named(pub $kind);

        impl std::fmt::Display for $named {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.pad(self.0.name())
            }
        }

        impl std::str::FromStr for $named {
            type Err = $crate::keys::UnknownChoice;

            fn from_str(name: &str) -> Result<Self, Self::Err> {
                let known = <$kind>::by_name(name).map(Self);
                known.ok_or_else(|| $crate::keys::UnknownChoice::new($what, name, <$kind>::NAMES))
            }
        }

        $crate::serde_by_name!($named);
    };
}

/// Serde through `Display` and `FromStr`.
#[macro_export]
macro_rules! serde_by_name {
    ($name:ident) => {
        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let name = <String as serde::Deserialize>::deserialize(deserializer)?;
                name.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}

pub(crate) use {choice, named, serde_by_name};
