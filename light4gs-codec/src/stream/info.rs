//! The contents of a stream, without decoding its numbers.

use super::{
    OpenStream,
    container::{Entry, Header},
    input::Profile,
    layers::LayerHeads,
};
use crate::{
    CodecError, ContextModelArrays, Limits, MotionArrays, PerGroup, PlaneBytes, SceneMeta,
    attributes::AttributeInfo,
    bytes::{
        Reader, Section,
        sections::{Encoding, Kind},
    },
    fields, motion,
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
    /// Puts together what an encoder, a decoder, or a reader of descriptions knows. `motion` is a description.
    pub(super) fn new(header: &Header, heads: LayerHeads, planes: planes::Summary, motion: MotionArrays) -> Self {
        let Header { prelude, meta, .. } = header;
        let planes::Summary { head, bytes: plane_bytes, steps: plane_steps, model: context_model } = planes;
        let layer = |(layer, &gaussians): (usize, &u32)| {
            let needed = (0..=layer).map(|layer| header.layer_bytes(layer));
            LayerInfo { gaussians, bytes_to_show: needed.max().unwrap_or(0) }
        };
        Self {
            version: prelude.version,
            flags: prelude.flags,
            profile: header.profile(),
            bytes: prelude.file_bytes,
            header_bytes: prelude.header_bytes(),
            meta: meta.clone(),
            sections: header.sections(),
            layers: heads.counts.iter().enumerate().map(layer).collect(),
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
        }
    }

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

    /// The profile of a compressed stream; `None` where nothing is compressed.
    fn profile(&self) -> Option<Profile> {
        let compact = |entry: &Entry| entry.section == Section::Gaussians && entry.encoding == Encoding::Quantized;
        if self.entries.iter().any(compact) {
            return Some(Profile::Compact);
        }
        let explicit = [Kind::ShExplicit, Kind::FeaturePlanesExplicit];
        let coded = |entry: &Entry| {
            matches!(entry.section, Section::Sh | Section::FeaturePlanes) && !explicit.contains(&entry.kind)
        };
        self.entries.iter().any(coded).then_some(Profile::Paper)
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
    let opened = OpenStream::with_limits(bytes, limits)?;
    let stream = opened.verified()?;
    describe(&stream, &stream.container.header, limits)
}

/// What the beginnings of the sections say, whose checksums have been checked. `header` is that of the whole stream.
pub(crate) fn describe(stream: &OpenStream<'_>, header: &Header, limits: &Limits) -> Result<StreamInfo, CodecError> {
    let open = |section: Section| {
        let (kind, _, payload) = stream.container.section(section)?;
        Ok::<_, CodecError>((kind, Reader::new(section.name(), payload)))
    };
    stream.check_sections()?;
    fields::check_finite_coordinates(&stream.coordinates()?)?;
    let heads = stream.heads()?;
    let motion = motion::section::read_description(&mut open(Section::Motion)?.1, limits)?;
    let (kind, mut reader) = open(Section::FeaturePlanes)?;
    let planes = if kind == Kind::FeaturePlanesExplicit {
        planes::Summary::explicit(planes::head::Head::read(&mut reader, limits)?)
    } else {
        let model = planes::context_section::read_description(&mut open(Section::ContextModel)?.1, limits)?;
        let length = header.entry(Section::FeaturePlanes, 0)?.bytes;
        planes::section::read_summary(reader.rest(), length, model, limits)?
    };
    Ok(StreamInfo::new(header, heads, planes, motion))
}
