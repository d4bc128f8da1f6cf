//! Errors of a scene or a stream.

use std::path::PathBuf;

use crate::format::VERSION;

/// What is wrong with a scene or a stream, where, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CodecError {
    /// The bytes do not begin like a `.l4gs` stream.
    #[error(
        "not a .l4gs stream: it begins with {found:02x?}, expected 89 4c 34 47 53 0d 0a 1a; is this the right file?"
    )]
    NotL4gs {
        /// The first bytes, at most eight.
        found: Vec<u8>,
    },
    /// The bytes are those of a take, which is a file of several streams.
    #[error(
        "it is a take, a file of several streams, expected a .l4gs stream of one clip; open it with `light4gs_codec::take::Take`, \
         or with `PlayableTake` of light4gs-render"
    )]
    IsTake,
    /// The bytes do not begin like a take.
    #[error(
        "not a take: it begins with {found:02x?}, expected 89 4c 34 47 54 0d 0a 1a; \
         a .l4gs stream of one clip (89 4c 34 47 53 0d 0a 1a) is opened with `decode`, `read_file` or `PlayableScene`"
    )]
    NotTake {
        /// The first bytes, at most eight.
        found: Vec<u8>,
    },
    /// The stream was written by a newer version of this crate.
    #[error("the stream has version {found}, this program reads versions up to {VERSION}; use a newer program")]
    NewerVersion {
        /// The version in the header.
        found: u16,
    },
    /// The bytes end too early.
    #[error(
        "{section}: {field} needs {needed} bytes, {available} are left; the stream is cut short or damaged, get it again"
    )]
    Truncated {
        /// The section that ends too early.
        section: &'static str,
        /// What was being read.
        field: String,
        /// Bytes that it needs.
        needed: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// There are more bytes than there should be.
    #[error(
        "{section}: {bytes} bytes too many at the end; the stream is damaged or something was appended, get it again"
    )]
    TrailingBytes {
        /// The section that should have ended.
        section: &'static str,
        /// Number of bytes after its end.
        bytes: u64,
    },
    /// The bytes are not those that were written.
    #[error("{section}: checksum {computed:08x}, expected {stored:08x}; the stream is damaged, get it again")]
    Checksum {
        /// The damaged section.
        section: &'static str,
        /// The checksum in the stream.
        stored: u32,
        /// The checksum of the bytes that are there.
        computed: u32,
    },
    /// The table names a section that this version does not have.
    #[error(
        "table: entry {index} has the unknown section id {id}; version {VERSION} has no such section, write the stream again"
    )]
    UnknownSection {
        /// Position in the table.
        index: u32,
        /// The id that is not known.
        id: u16,
    },
    /// The section is of a kind that this version does not know.
    #[error("{section}: unknown kind {kind}; use a newer program")]
    UnknownKind {
        /// The section.
        section: &'static str,
        /// The number that is not known.
        kind: u8,
    },
    /// The numbers of a section are stored in an encoding that this version does not know for this kind.
    #[error("{section}: unknown encoding {encoding} of the kind \"{kind}\"; use a newer program")]
    UnknownEncoding {
        /// The section.
        section: &'static str,
        /// What it holds.
        kind: &'static str,
        /// The number that is not known.
        encoding: u8,
    },
    /// Gaussians have an attribute without which the scene looks wrong, and it is not known what the attribute does.
    #[error(
        "gaussians: the scene looks wrong without the attribute `{name}`, and neither this program nor the file knows what it does; \
         use the program that wrote the file, or a newer one"
    )]
    UnknownAttribute {
        /// Its name.
        name: String,
    },
    /// A section stands twice in the table.
    #[error("{section}: the section stands twice in the table, expected once; write the stream again")]
    DuplicateSection {
        /// The section.
        section: &'static str,
    },
    /// A section is not in the table.
    #[error("{section}: the section is missing; write the stream again")]
    MissingSection {
        /// The section.
        section: &'static str,
    },
    /// A number is beyond what a reader accepts.
    #[error(
        "{section}: {field} is {found}, at most {limit} is accepted; make the scene smaller, or \
         raise the limit if you trust the file (`--limits large`, `Limits::large`)"
    )]
    OverLimit {
        /// The section.
        section: &'static str,
        /// The number's name.
        field: String,
        /// The number.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// A value is NaN or infinite.
    #[error(
        "{section}: value {index} of {field} is {value}, expected a finite number; repair the scene before writing it"
    )]
    NonFinite {
        /// The section.
        section: &'static str,
        /// The array.
        field: String,
        /// Position in the flattened array.
        index: usize,
        /// The value.
        value: f32,
    },
    /// A field disagrees with the format or with another field.
    #[error("{section}: {field} is {found}, expected {expected}")]
    Invalid {
        /// The section.
        section: &'static str,
        /// The field.
        field: String,
        /// What it is.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// What was written does not decode to what was given: a bug of this crate.
    #[error(
        "{section}: {field} did not survive encoding; nothing was written. This is a fault of light4gs-codec, please report it"
    )]
    SelfCheck {
        /// The section.
        section: &'static str,
        /// The field that differs.
        field: String,
    },
    /// A file is wrong; the error inside says how.
    #[error("{}: {error}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: Box<CodecError>,
    },
    /// A stream of a take is wrong; the error inside says how.
    #[error("{part} of the take: {error}")]
    InTake {
        /// Which of its streams: `base`, or `segment` and its number in time, from 0.
        part: String,
        /// What is wrong with it.
        error: Box<CodecError>,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {error}", path.display())]
    Io {
        /// What was tried, such as `read`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
}

impl CodecError {
    /// Whether it is a bug of this crate, and not wrong input.
    pub fn is_internal(&self) -> bool {
        matches!(self, Self::SelfCheck { .. })
    }

    /// What is wrong, in one word that stays the same: the name of the variant in lower case, such as `over-limit`. For an error
    /// in a file or a take it is that of the error inside.
    ///
    /// ```
    /// let error = light4gs_codec::decode(b"PK").unwrap_err();
    /// assert_eq!(error.kind(), "not-l4gs");
    /// ```
    pub fn kind(&self) -> &'static str {
        match self {
            Self::NotL4gs { .. } => "not-l4gs",
            Self::IsTake => "is-take",
            Self::NotTake { .. } => "not-take",
            Self::NewerVersion { .. } => "newer-version",
            Self::Truncated { .. } => "truncated",
            Self::TrailingBytes { .. } => "trailing-bytes",
            Self::Checksum { .. } => "checksum",
            Self::UnknownSection { .. } => "unknown-section",
            Self::UnknownKind { .. } => "unknown-kind",
            Self::UnknownEncoding { .. } => "unknown-encoding",
            Self::UnknownAttribute { .. } => "unknown-attribute",
            Self::DuplicateSection { .. } => "duplicate-section",
            Self::MissingSection { .. } => "missing-section",
            Self::OverLimit { .. } => "over-limit",
            Self::NonFinite { .. } => "non-finite",
            Self::Invalid { .. } => "invalid",
            Self::SelfCheck { .. } => "self-check",
            Self::InFile { error, .. } | Self::InTake { error, .. } => error.kind(),
            Self::Io { .. } => "io",
        }
    }

    /// An [`CodecError::Invalid`] from any value that can be printed.
    pub(crate) fn invalid(
        section: &'static str,
        field: impl Into<String>,
        found: impl ToString,
        expected: impl Into<String>,
    ) -> Self {
        Self::Invalid { section, field: field.into(), found: found.to_string(), expected: expected.into() }
    }
}
