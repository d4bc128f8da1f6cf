//! The sections of a stream, one file each. Each has a head, the counts and shapes, and then the numbers.

pub(crate) mod coded_hexplanes;
pub(crate) mod coded_sh;
pub(crate) mod context_model;
pub(crate) mod deformation;
pub(crate) mod gaussians;
pub(crate) mod hexplanes;
pub(crate) mod meta;
pub(crate) mod scene_frame;
pub(crate) mod sh;
pub(crate) mod weights;

use crate::CodecError;

/// What a section holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SectionKind {
    Gaussians,
    Sh,
    SceneFrame,
    Deformation,
    HexPlanes,
    ContextModel,
}

impl SectionKind {
    /// The sections that every stream has, in the order in which version 1 writes them.
    pub(crate) const CORE: [Self; 5] =
        [Self::Gaussians, Self::Sh, Self::SceneFrame, Self::Deformation, Self::HexPlanes];
    /// Every section, in the order of their numbers.
    pub(crate) const ALL: [Self; 6] =
        [Self::Gaussians, Self::Sh, Self::SceneFrame, Self::Deformation, Self::HexPlanes, Self::ContextModel];

    /// The number that stands in the table.
    pub(crate) const fn id(self) -> u16 {
        match self {
            Self::Gaussians => 1,
            Self::Sh => 2,
            Self::SceneFrame => 3,
            Self::Deformation => 4,
            Self::HexPlanes => 5,
            Self::ContextModel => 6,
        }
    }

    /// The section with a number of the table.
    pub(crate) fn from_id(id: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.id() == id)
    }

    /// The name in messages.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Gaussians => "gaussians",
            Self::Sh => "sh",
            Self::SceneFrame => "scene_frame",
            Self::Deformation => "deformation",
            Self::HexPlanes => "hexplanes",
            Self::ContextModel => "context_model",
        }
    }
}

/// Refuses an array whose length is not what the counts and shapes say.
fn check_length(
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
