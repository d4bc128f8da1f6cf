//! The contents of a stream, without decoding its numbers.

use super::{
    OpenStream,
    container::{Entry, Header},
    input::Profile,
};
use crate::{
    CodecError, ContextModelArrays, Limits, MotionArrays, PerGroup, PlaneBytes, SceneMeta,
    attributes::AttributeInfo,
    bytes::{
        Reader, Section,
        sections::{Encoding, Kind},
    },
    motion::section,
    plane_layout::PlaneLayout,
    planes,
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
    /// The layers of Gaussians, at least one.
    pub layers: Vec<LayerInfo>,
    /// Number of Gaussians of all layers.
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

/// One layer of Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerInfo {
    /// Its Gaussians.
    pub gaussians: u32,
    /// Bytes from the beginning of the stream to the end of this layer. With them it and the layers before can be
    /// shown: for the first layer, they are the bytes to the first image.
    pub bytes_to_show: u64,
}

impl SectionInfo {
    /// Names of sections with their bytes, in the order of the stream; the sections of all layers together.
    pub fn bytes_by_name(sections: &[Self]) -> Vec<(&'static str, u64)> {
        let mut sums: Vec<(&'static str, u64)> = Vec::new();
        for section in sections {
            match sums.iter_mut().find(|(name, _)| *name == section.name) {
                Some((_, sum)) => *sum += section.bytes,
                None => sums.push((section.name, section.bytes)),
            }
        }
        sums
    }
}

impl StreamInfo {
    /// Bytes from the beginning of the stream that a player needs for the first image.
    pub fn bytes_to_first_image(&self) -> u64 {
        self.layers.first().map_or(self.bytes, |layer| layer.bytes_to_show)
    }
}

impl Header {
    /// The sections, in the order of the stream.
    pub(crate) fn sections(&self) -> Vec<SectionInfo> {
        let section = |entry: &Entry| SectionInfo {
            name: entry.section.name(),
            kind: entry.kind,
            encoding: entry.encoding,
            offset: entry.offset,
            bytes: entry.bytes,
            crc: entry.crc,
        };
        self.entries.iter().map(section).collect()
    }
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
    let stream = OpenStream::with_limits(bytes, limits)?;
    stream.check_sums()?;
    let heads = stream.heads()?;
    let container = &stream.container;
    let limits = limits.for_stream(bytes.len());
    let open = |section: Section| {
        let (kind, encoding, payload) = container.section(section)?;
        Ok::<_, CodecError>((kind, encoding, Reader::new(section.name(), payload)))
    };
    let (gaussian_encoding, sh_kind) = (open(Section::Gaussians)?.1, open(Section::Sh)?.0);
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

    let Header { prelude, meta, .. } = &*container.header;
    let mut bytes_to_show = 0;
    let layers = heads.counts.iter().enumerate().map(|(layer, &gaussians)| {
        bytes_to_show = container.header.layer_bytes(layer).max(bytes_to_show);
        LayerInfo { gaussians, bytes_to_show }
    });
    Ok(StreamInfo {
        version: prelude.version,
        flags: prelude.flags,
        profile: coded.then_some(profile),
        bytes: prelude.file_bytes,
        header_bytes: prelude.header_bytes(),
        meta: meta.clone(),
        sections: container.header.sections(),
        layers: layers.collect(),
        // `LayerHeads` has compared the sum with a limit.
        gaussian_count: heads.counts.iter().sum(),
        attributes: heads.attributes,
        sh_degree: heads.degree,
        plane_channels: head.channels,
        planes: head.layout,
        plane_bytes,
        plane_steps,
        context_model,
        motion,
    })
}
