//! Names among which a key chooses, and the error for a name that is none of them.

/// The names among which a key chooses.
#[derive(Debug)]
pub struct Choices {
    /// The thing that is chosen, for messages.
    pub what: &'static str,
    /// The names.
    pub names: &'static [&'static str],
    /// The meaning of each name, in lines.
    pub meanings: &'static [&'static [&'static str]],
}

impl Choices {
    /// The error for a name, if it is none of these.
    pub(crate) fn unknown(&self, name: &str) -> Option<UnknownChoice> {
        (!self.names.contains(&name)).then(|| UnknownChoice::new(self.what, name, self.names))
    }

    /// Each name with the first sentence of its meaning.
    pub(crate) fn explained(&self) -> String {
        let explained = self.names.iter().zip(self.meanings).map(|(name, meaning)| {
            let meaning = joined(meaning);
            let first = meaning.split_once(". ").map_or(meaning.trim_end_matches('.'), |(first, _)| first);
            format!("`\"{name}\"`: {first}.")
        });
        explained.collect::<Vec<_>>().join(" ")
    }
}

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
    ///
    /// # Panics
    /// If it is.
    pub fn new(what: &'static str, name: &str, known: &'static [&'static str]) -> Self {
        let nearest = nearest(known.iter().copied(), name).expect("some names are known");
        Self { what, name: name.to_owned(), nearest, known }
    }
}

/// The most similar of the known names: one that begins with the name if there is one.
pub fn nearest<'a>(known: impl IntoIterator<Item = &'a str>, name: &str) -> Option<&'a str> {
    let difference = |known: &&str| (!known.starts_with(name), strsim::damerau_levenshtein(known, name));
    known.into_iter().min_by_key(difference)
}

/// The lines of a comment, joined to one.
pub(crate) fn joined(lines: &[&str]) -> String {
    lines.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
}
