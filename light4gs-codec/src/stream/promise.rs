//! The most bytes that a section can have: a longer one is refused before it is read.
//!
//! A table can promise any length, and a file can have it without taking room on a disk. The head of a section says how many
//! numbers the section holds, and so how long it can be at most.

use super::container::Entry;
use crate::{
    CodecError, Limits, attributes,
    bytes::{
        Reader,
        sections::{Encoding, Kind, Section},
    },
    motion, planes, sh,
};

/// Bytes that every section may have. Those at the beginning of a longer one hold its head.
pub(crate) const HEAD_BYTES: u64 = 1 << 20;
/// Bytes that a coded number may take; a float32 takes four.
const CODED: u64 = 16;
/// Bytes that a frequency table may take.
const TABLE: u64 = 1 << 16;

impl Entry {
    /// The bytes at its beginning that [`Entry::check_length`] needs.
    pub(crate) fn head_bytes(&self) -> u64 {
        self.bytes.min(HEAD_BYTES)
    }

    /// Refuses a section that is longer than what its head says can take. `beginning` has its [`Entry::head_bytes`].
    pub(crate) fn check_length(&self, beginning: &[u8], limits: &Limits) -> Result<(), CodecError> {
        if self.bytes <= HEAD_BYTES {
            return Ok(());
        }
        let (section, most) = (self.section.name(), self.most_bytes(beginning, limits)?.saturating_add(HEAD_BYTES));
        if self.bytes <= most {
            return Ok(());
        }
        let expected =
            format!("at most {most}, which is enough for what its head says; the stream is damaged, get it again");
        Err(CodecError::invalid(section, "length of the section", self.bytes, expected))
    }

    /// The most bytes of its numbers, without head and padding.
    fn most_bytes(&self, beginning: &[u8], limits: &Limits) -> Result<u64, CodecError> {
        let mut reader = Reader::new(self.section.name(), beginning);
        let explicit = self.encoding == Encoding::Float32;
        let each = if explicit { 4 } else { CODED };
        Ok(match self.section {
            Section::Gaussians => {
                let head = attributes::Head::read(&mut reader, self.encoding, limits)?;
                let numbers: u64 = head.attributes.iter().map(|attribute| u64::from(attribute.width)).sum();
                (each * u64::from(head.count)).saturating_mul(numbers)
            }
            Section::Sh => {
                let sh::section::Promise { values, tables, weights } =
                    sh::section::promise(&mut reader, self.kind, limits)?;
                let each = if self.kind == Kind::ShExplicit { 4 } else { CODED };
                (each * values).saturating_add(TABLE * tables).saturating_add(CODED.saturating_mul(weights))
            }
            Section::SceneCoordinates => 0,
            Section::Motion => each.saturating_mul(motion::section::read_description(&mut reader, limits)?.weights()),
            Section::FeaturePlanes => {
                let head = planes::head::Head::read(&mut reader, limits)?;
                let planes = head.layout.planes().iter();
                let values = planes.fold(0_u64, |sum, plane| sum.saturating_add(head.values(plane.size)));
                // The latents of coded planes are counted as a second set of values.
                values.saturating_mul(if explicit { 4 } else { 2 * CODED })
            }
            Section::ContextModel => {
                let model = planes::context_section::read_description(&mut reader, limits)?;
                let weights = model.networks.iter().fold(0_u64, |sum, network| sum.saturating_add(network.weights()));
                each.saturating_mul(weights).saturating_add(TABLE * u64::from(model.latent_channels()))
            }
        })
    }
}
