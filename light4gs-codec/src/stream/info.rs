//! The contents of a stream, without decoding its numbers.

use super::{container::Container, input::Profile};
use crate::{
    CodecError, ContextModelArrays, Limits, MotionArrays, PerGroup, PlaneBytes, SceneMeta,
    attributes::{self, AttributeInfo},
    bytes::{
        Reader, Section,
        sections::{Encoding, Kind},
    },
    motion::section,
    plane_layout::PlaneLayout,
    planes, sh,
};

/// The contents of a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamInfo {
    /// Version of the format.
    pub version: u16,
    /// Flags of the header; there are none yet.
    pub flags: u16,
    /// The profile of a compressed stream; `None` where nothing is compressed.
    pub profile: Option<Profile>,
    /// Bytes of the whole stream.
    pub bytes: u64,
    /// Bytes before the first section: prelude, meta and table.
    pub header_bytes: u64,
    /// The scene meta.
    pub meta: SceneMeta,
    /// The sections, in the order of the stream.
    pub sections: Vec<SectionInfo>,
    /// Number of Gaussians.
    pub gaussian_count: u32,
    /// The attributes of every Gaussian, without the spherical harmonics beyond degree 0.
    pub attributes: Vec<AttributeInfo>,
    /// Degree of the spherical harmonics.
    pub sh_degree: u8,
    /// Channels of every feature plane.
    pub plane_channels: u32,
    /// The feature planes: scales, axes, sizes.
    pub planes: PlaneLayout,
    /// Bytes of each plane, in the order of the planes; empty where they are float32.
    pub plane_bytes: Vec<PlaneBytes>,
    /// Quantization steps of the planes, one entry for all scales or one for each; empty where they are float32.
    pub plane_steps: Vec<PerGroup>,
    /// The context model without its numbers, where planes are coded with one.
    pub context_model: Option<ContextModelArrays>,
    /// How the Gaussians move, without the numbers.
    pub motion: MotionArrays,
}

/// One section of a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// Its name.
    pub name: &'static str,
    /// Its kind.
    pub kind: Kind,
    /// How its numbers are stored.
    pub encoding: Encoding,
    /// Where it begins in the stream.
    pub offset: u64,
    /// Its length.
    pub bytes: u64,
    /// CRC-32C of its bytes.
    pub crc: u32,
}

/// Summarizes a stream: header, meta, counts, and the size of every section.
///
/// All checksums are checked, so this is also a quick test of a file for damage.
///
/// # Errors
/// As [`crate::decode`], except for errors that show only in decoded numbers.
pub fn info(bytes: &[u8]) -> Result<StreamInfo, CodecError> {
    info_with_limits(bytes, &Limits::default())
}

/// As [`info`], within limits of the caller.
///
/// # Errors
/// As [`info`].
pub fn info_with_limits(bytes: &[u8], limits: &Limits) -> Result<StreamInfo, CodecError> {
    let container = Container::read(bytes, limits)?;
    for section in Section::ALL {
        if container.has(section) {
            container.section(section)?;
        }
    }
    let limits = limits.for_stream(bytes.len());
    let open = |section: Section| {
        let (kind, encoding, payload) = container.section(section)?;
        Ok::<_, CodecError>((kind, encoding, Reader::new(section.name(), payload)))
    };
    let (_, gaussian_encoding, mut reader) = open(Section::Gaussians)?;
    let gaussians = attributes::Head::read(&mut reader, gaussian_encoding, &limits)?;
    let (sh_kind, _, mut reader) = open(Section::Sh)?;
    let sh = sh::section::Head::read(&mut reader, &limits)?;
    let motion = section::read_description(&mut open(Section::Motion)?.2, &limits)?;
    let (plane_kind, _, mut reader) = open(Section::FeaturePlanes)?;
    let (mut plane_bytes, mut plane_steps, mut context_model) = (Vec::new(), Vec::new(), None);
    let head = if plane_kind == Kind::FeaturePlanesExplicit {
        planes::head::Head::read(&mut reader, &limits)?
    } else {
        let model = planes::context_section::read_description(&mut open(Section::ContextModel)?.2, &limits)?;
        let (parts, bytes) = planes::section::plane_bytes(reader.rest(), &model, &limits)?;
        (plane_bytes, plane_steps, context_model) = (bytes, parts.steps, Some(model));
        parts.head
    };
    let compact = gaussian_encoding == Encoding::Quantized;
    let coded = compact || plane_kind != Kind::FeaturePlanesExplicit || sh_kind != Kind::ShExplicit;
    let profile = if compact { Profile::Compact } else { Profile::Paper };

    let sections: Vec<_> = container
        .entries
        .iter()
        .map(|entry| SectionInfo {
            name: entry.section.name(),
            kind: entry.kind,
            encoding: entry.encoding,
            offset: entry.offset,
            bytes: entry.bytes,
            crc: entry.crc,
        })
        .collect();
    Ok(StreamInfo {
        version: container.prelude.version,
        flags: container.prelude.flags,
        profile: coded.then_some(profile),
        bytes: container.prelude.file_bytes,
        header_bytes: container.prelude.file_bytes - sections.iter().map(|section| section.bytes).sum::<u64>(),
        meta: container.meta,
        sections,
        gaussian_count: gaussians.count,
        attributes: gaussians.attributes,
        sh_degree: sh.degree,
        plane_channels: head.channels,
        planes: head.layout,
        plane_bytes,
        plane_steps,
        context_model,
        motion,
    })
}
