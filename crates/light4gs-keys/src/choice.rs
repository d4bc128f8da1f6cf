//! The macro `choice!`: enums whose variants have a name in TOML, and parts with keys that are chosen by such a name.

/// Declares the names among which a key chooses.
///
/// Plain names: an enum with `NAMES` and `name`. `Display` and serde write the name, `FromStr` and serde read it. An
/// unknown name is an [`UnknownChoice`](crate::UnknownChoice) with the nearest one. A key of this type has the bounds `PartKind::BOUNDS`.
///
/// ```
/// light4gs_keys::choice! {
///     /// The parts by name.
///     pub enum PartKind: "part" {
///         /// The meaning of the name, for rustdoc and for docs/configuration.md.
///         First = "first",
///         /// The other one.
///         Second = "second",
///     }
/// }
/// assert_eq!(PartKind::First.to_string(), "first");
/// ```
///
/// Further traits may be derived, as `#[derive(Default)]` with a `#[default]` behind the words of a name.
///
/// Parts with keys of their own: the names as above, and a struct with the keys of every part, which is flattened into
/// the table of the key that chooses. The keys of a part are in a table of its name; its type is declared by
/// [`keys!`](crate::keys), or it is `()` if there are none. The struct gives the part of a name: as a trait object,
/// or, for `enum Part` in place of `dyn Part`, as an enum of the parts' types.
///
/// ```
/// use light4gs_keys::{SHARE, choice, keys};
///
/// trait Part {
///     fn size(&self) -> f32;
/// }
///
/// keys! {
///     /// The effect of the part. It is the meaning of its name, unless the list of names has another one.
///     pub struct Whole {
///         /// Its size.
///         size: f32 = 0.5; SHARE, "ours";
///     }
/// }
///
/// impl Part for Whole {
///     fn size(&self) -> f32 {
///         self.size
///     }
/// }
///
/// choice! {
///     /// The parts by name.
///     pub enum PartKind: "part" {
///         Whole = whole: Whole,
///     }
///     /// The keys of all parts.
///     pub struct Parts: dyn Part;
/// }
/// assert_eq!(Parts::default().of(PartKind::Whole).size(), 0.5);
/// ```
#[macro_export]
macro_rules! choice {
    (
        $(#[doc = $about:literal])+
        $(#[derive($($trait:ident),+)])?
        pub enum $choice:ident: $what:literal {
            $($(#[doc = $meaning:literal])+ $(#[default $($default:tt)?])? $variant:ident = $name:literal,)+
        }
    ) => {
        $crate::names! {
            [$(#[doc = $about])+ $(#[derive($($trait),+)])?] $choice $what
            $([$(#[doc = $meaning])+ $(#[default $($default)?])?] $variant [$name] [&[$($meaning),+]])+
        }
    };
    (
        $(#[doc = $about:literal])+
        pub enum $choice:ident: $what:literal {
            $($(#[doc = $meaning:literal])* $(#[serde $serde:tt])? $variant:ident = $name:ident: $type:ty,)+
        }
        $(#[doc = $parts_about:literal])+
        pub struct $parts:ident: $form:tt $part:ident;
    ) => {
        $crate::names! {
            [$(#[doc = $about])+] $choice $what
            $(
                [$(#[doc = $meaning])* #[doc = concat!("\n\nKeys: [`", stringify!($type), "`].")]]
                $variant [stringify!($name)]
                [$crate::meaning(&[$($meaning),*], <$type as $crate::KeyTable>::ABOUT)]
            )+
        }

        $(#[doc = $parts_about])+
        #[derive(Debug, Clone, Default, PartialEq, $crate::serde::Serialize, $crate::serde::Deserialize)]
        #[serde(default, crate = "light4gs_keys::serde")]
        pub struct $parts {
            $(
                #[doc = concat!("The keys of [`", stringify!($type), "`].")]
                $(#[serde $serde])?
                #[serde(skip_serializing_if = "light4gs_keys::has_no_keys")]
                pub $name: $type,
            )+
        }

        $crate::chosen! { $choice $parts $form [$part] $($variant $name [$type])+ }

        impl $crate::KeyTable for $parts {
            const ABOUT: &'static [&'static str] = &[];
            const ENTRIES: &'static [$crate::Entry] = &[$($crate::entry!([$($serde)?] [] $name: $type),)+];

            fn problems(&self, at: &str, into: &mut Vec<$crate::Problem>) {
                $($crate::problems!([$($serde)?] self at into $name);)+
            }
        }
    };
}

/// The meaning of a name: its own, or else that of its part.
#[doc(hidden)]
pub const fn meaning(own: &'static [&'static str], of_part: &'static [&'static str]) -> &'static [&'static str] {
    if own.is_empty() { of_part } else { own }
}

/// The enum of a [`choice!`].
#[doc(hidden)]
#[macro_export]
macro_rules! names {
    (
        [$(#[$about:meta])+] $choice:ident $what:literal
        $([$(#[$attribute:meta])*] $variant:ident [$($name:tt)+] [$meaning:expr])+
    ) => {
        $(#[$about])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $choice {
            $($(#[$attribute])* #[doc = concat!("\n\nIn TOML: `", $($name)+, "`.")] $variant,)+
        }

        impl $choice {
            /// Every choice, in order.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// Their names.
            pub const NAMES: &'static [&'static str] = &[$($($name)+),+];

            /// The bounds of a key of this type.
            pub const BOUNDS: $crate::Bounds = {
                const CHOICES: $crate::Choices =
                    $crate::Choices { what: $what, names: $choice::NAMES, meanings: &[$($meaning),+] };
                $crate::Bounds::Name(&CHOICES)
            };

            /// The name in files.
            pub fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }
        }

        impl $crate::KeyValue for $choice {}

        impl std::fmt::Display for $choice {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.pad(self.name())
            }
        }

        impl std::str::FromStr for $choice {
            type Err = $crate::UnknownChoice;

            fn from_str(name: &str) -> Result<Self, Self::Err> {
                let known = Self::ALL.iter().find(|choice| choice.name() == name);
                known.copied().ok_or_else(|| $crate::UnknownChoice::new($what, name, Self::NAMES))
            }
        }

        impl $crate::serde::Serialize for $choice {
            fn serialize<S: $crate::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }

        impl<'de> $crate::serde::Deserialize<'de> for $choice {
            fn deserialize<D: $crate::serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let name = <String as $crate::serde::Deserialize>::deserialize(deserializer)?;
                name.parse().map_err($crate::serde::de::Error::custom)
            }
        }
    };
}

/// From a name to the part with its keys.
#[doc(hidden)]
#[macro_export]
macro_rules! chosen {
    ($choice:ident $parts:ident dyn [$part:ident] $($variant:ident $name:ident [$type:ty])+) => {
        impl $parts {
            /// The part of a name, with its keys.
            pub fn of(&self, name: $choice) -> Box<dyn $part> {
                match name {
                    $($choice::$variant => Box::new(self.$name.clone()),)+
                }
            }
        }
    };
    ($choice:ident $parts:ident enum [$part:ident] $($variant:ident $name:ident [$type:ty])+) => {
        #[doc = concat!("One of the parts that [`", stringify!($choice), "`] names, with its keys.")]
        #[derive(Debug, Clone, PartialEq)]
        pub enum $part {
            $(#[doc = concat!("[`", stringify!($choice), "::", stringify!($variant), "`]")] $variant($type),)+
        }

        impl $parts {
            /// The part of a name, with its keys.
            pub fn of(&self, name: $choice) -> $part {
                match name {
                    $($choice::$variant => $part::$variant(self.$name.clone()),)+
                }
            }
        }
    };
}

#[cfg(test)]
#[allow(unreachable_pub, reason = "the macro declares public items")]
mod tests {
    use crate::{Bounds, KeyTable, Problem, SHARE, keys};

    keys! {
        /// Has a share. It is small.
        pub struct Left {
            /// Its share.
            share: f32 = 0.25; SHARE, "ours";
        }
    }

    choice! {
        /// A side.
        pub enum Side: "side" {
            Left = left: Left,
            /// Has nothing.
            Right = right: (),
        }
        /// The keys of both.
        pub struct Sides: enum OneSide;
    }

    #[test]
    fn names_are_read_and_written() {
        for (side, name) in Side::ALL.iter().zip(["left", "right"]) {
            assert_eq!((side.to_string().as_str(), name.parse()), (name, Ok(*side)));
        }
        let error = "rihgt".parse::<Side>().unwrap_err();
        assert_eq!(error.to_string(), "unknown side `rihgt`; the nearest is `right` (it must be one of left, right)");
        let unreadable = Side::BOUNDS.unreadable(&toml::Value::String("rihgt".to_owned()));
        assert_eq!(unreadable, Some(error.to_string()));
        assert_eq!(Side::BOUNDS.unreadable(&toml::Value::String("left".to_owned())), None);
    }

    #[test]
    fn a_part_has_its_keys() {
        let sides: Sides = toml::from_str("left.share = 2.0").unwrap();
        assert_eq!(sides.of(Side::Left), OneSide::Left(Left { share: 2.0 }));
        assert_eq!(sides.of(Side::Right), OneSide::Right(()));
        assert_eq!(toml::to_string(&sides).unwrap(), "[left]\nshare = 2.0\n");
        let mut problems = Vec::new();
        sides.problems("side.", &mut problems);
        let expected = Problem { key: "side.left.share".to_owned(), message: "is 2; it must be 0 to 1".to_owned() };
        assert_eq!(problems, [expected]);
    }

    #[test]
    fn a_name_means_what_its_part_says_unless_it_has_words_of_its_own() {
        let Bounds::Name(choices) = Side::BOUNDS else { panic!("a choice has names") };
        assert_eq!(choices.explained(), "`\"left\"`: Has a share. `\"right\"`: Has nothing.");
    }
}
