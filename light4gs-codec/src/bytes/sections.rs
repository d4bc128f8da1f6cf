//! Which sections there are, what they may hold, and how their numbers are stored.

use crate::CodecError;

/// A section of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Section {
    Gaussians,
    Sh,
    SceneCoordinates,
    Motion,
    FeaturePlanes,
    ContextModel,
}

impl Section {
    /// Every section, in the order of their numbers.
    pub(crate) const ALL: [Self; 6] =
        [Self::Gaussians, Self::Sh, Self::SceneCoordinates, Self::Motion, Self::FeaturePlanes, Self::ContextModel];

    /// The number that stands in the table.
    pub(crate) const fn id(self) -> u16 {
        match self {
            Self::Gaussians => 1,
            Self::Sh => 2,
            Self::SceneCoordinates => 3,
            Self::Motion => 4,
            Self::FeaturePlanes => 5,
            Self::ContextModel => 6,
        }
    }

    /// The section with a number of the table.
    pub(crate) fn from_id(id: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|section| section.id() == id)
    }

    /// Whether there is one for each layer of Gaussians.
    pub(crate) const fn is_layered(self) -> bool {
        matches!(self, Self::Gaussians | Self::Sh)
    }

    /// The name in messages.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Gaussians => "gaussians",
            Self::Sh => "sh",
            Self::SceneCoordinates => "scene_coordinates",
            Self::Motion => "motion",
            Self::FeaturePlanes => "feature_planes",
            Self::ContextModel => "context_model",
        }
    }
}

/// What a section holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Gaussians, each with its own attributes.
    GaussiansExplicit,
    /// Spherical harmonics as float32.
    ShExplicit,
    /// Spherical harmonics with one frequency table for each channel.
    ShTables,
    /// Spherical harmonics with distributions that networks give.
    ShNetworks,
    /// Spherical harmonics, coded adaptively as other attributes.
    ShChannels,
    /// Spherical harmonics of a layer after the first, under the tables or networks of the first one.
    ShContinued,
    /// Mean, principal axes and deviations of a cloud.
    SceneCoordinatesPrincipalAxes,
    /// The same, with a mapping of their coordinates other than the paper's.
    SceneCoordinatesMapped,
    /// The motion as a description, whose kind stands in the section itself.
    MotionDescription,
    /// Planes as float32.
    FeaturePlanesExplicit,
    /// Planes under a context model.
    FeaturePlanesContextCoded,
    /// A context model as networks.
    ContextModelNetworks,
}

impl Kind {
    const ALL: [Self; 12] = [
        Self::GaussiansExplicit,
        Self::ShExplicit,
        Self::ShTables,
        Self::ShNetworks,
        Self::ShChannels,
        Self::ShContinued,
        Self::SceneCoordinatesPrincipalAxes,
        Self::SceneCoordinatesMapped,
        Self::MotionDescription,
        Self::FeaturePlanesExplicit,
        Self::FeaturePlanesContextCoded,
        Self::ContextModelNetworks,
    ];

    /// The section that holds this kind, and the kind's number in the table.
    pub(crate) const fn place(self) -> (Section, u8) {
        match self {
            Self::GaussiansExplicit => (Section::Gaussians, 1),
            Self::ShExplicit => (Section::Sh, 1),
            Self::ShTables => (Section::Sh, 2),
            Self::ShNetworks => (Section::Sh, 3),
            Self::ShChannels => (Section::Sh, 4),
            Self::ShContinued => (Section::Sh, 5),
            Self::SceneCoordinatesPrincipalAxes => (Section::SceneCoordinates, 1),
            Self::SceneCoordinatesMapped => (Section::SceneCoordinates, 2),
            Self::MotionDescription => (Section::Motion, 1),
            Self::FeaturePlanesExplicit => (Section::FeaturePlanes, 1),
            Self::FeaturePlanesContextCoded => (Section::FeaturePlanes, 2),
            Self::ContextModelNetworks => (Section::ContextModel, 1),
        }
    }

    /// The kind with a number of the table in a section.
    pub(crate) fn from_number(section: Section, number: u8) -> Result<Self, CodecError> {
        let known = Self::ALL.into_iter().find(|kind| kind.place() == (section, number));
        known.ok_or(CodecError::UnknownKind { section: section.name(), kind: number })
    }

    /// The encodings that it may have.
    fn encodings(self) -> &'static [Encoding] {
        match self {
            Self::ShExplicit
            | Self::SceneCoordinatesPrincipalAxes
            | Self::SceneCoordinatesMapped
            | Self::FeaturePlanesExplicit => &[Encoding::Float32],
            Self::ShTables | Self::ShChannels | Self::ShContinued | Self::FeaturePlanesContextCoded => {
                &[Encoding::Quantized]
            }
            _ => &[Encoding::Float32, Encoding::Quantized],
        }
    }

    /// The name of the kind in its section.
    pub const fn name(self) -> &'static str {
        match self {
            Self::GaussiansExplicit | Self::ShExplicit | Self::FeaturePlanesExplicit => "explicit",
            Self::ShTables => "tables",
            Self::ShChannels => "channels",
            Self::ShContinued => "continued",
            Self::ShNetworks | Self::ContextModelNetworks => "networks",
            Self::SceneCoordinatesPrincipalAxes => "principal axes",
            Self::SceneCoordinatesMapped => "mapped principal axes",
            Self::MotionDescription => "description",
            Self::FeaturePlanesContextCoded => "context coded",
        }
    }
}

/// How the numbers of a section are stored. In sections with networks, this is about their weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// Plain little-endian float32.
    Float32,
    /// Quantized, then entropy coded.
    Quantized,
}

impl Encoding {
    /// The number that stands in the table.
    pub const fn number(self) -> u8 {
        match self {
            Self::Float32 => 0,
            Self::Quantized => 1,
        }
    }

    /// The encoding with a number of the table, for a kind that may have it.
    pub(crate) fn from_number(kind: Kind, number: u8) -> Result<Self, CodecError> {
        let known = kind.encodings().iter().copied().find(|encoding| encoding.number() == number);
        let section = kind.place().0.name();
        known.ok_or(CodecError::UnknownEncoding { section, kind: kind.name(), encoding: number })
    }

    /// A name for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Float32 => "float32",
            Self::Quantized => "quantized",
        }
    }
}

/// Refuses an array whose length is not the one that follows from counts and shapes.
pub(crate) fn check_length(
    section: &'static str,
    field: impl Into<String>,
    found: usize,
    expected: u64,
    why: &str,
) -> Result<(), CodecError> {
    if found as u64 == expected {
        return Ok(());
    }
    Err(CodecError::invalid(section, format!("length of {}", field.into()), found, format!("{expected} ({why})")))
}
