//! What a stream holds, without decoding its numbers.

use crate::{
    CodecError, ContextModelShape, Encoding, HeadFlags, Limits, PerGroup, PlaneBytes, Profile, SceneMeta,
    container::{Container, PLAIN_VERSION},
    reader::Reader,
    sections::{SectionKind, coded_hexplanes, coded_sh, context_model, deformation, gaussians, hexplanes, meta, sh},
};

/// What a stream holds.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamInfo {
    /// Version of the format.
    pub version: u16,
    /// Flags of the header; there are none yet.
    pub flags: u16,
    /// What a compressed stream keeps in full precision; nothing for version 1, which is not compressed.
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
    /// Degree of the spherical harmonics.
    pub sh_degree: u8,
    /// Channels of the hexplane.
    pub hexplane_channels: u32,
    /// Base resolution of the hexplane along x, y, z, t.
    pub hexplane_resolution: [u32; 4],
    /// Multipliers of the resolution, one a scale.
    pub hexplane_multipliers: Vec<u32>,
    /// Planes of all scales.
    pub plane_count: usize,
    /// Bytes of each plane, in the order xy, xz, xt, yz, yt, zt, scale by scale; empty where they are float32.
    pub plane_bytes: Vec<PlaneBytes>,
    /// Quantisation steps of the planes, one entry for all scales or one a scale; empty where they are float32.
    pub plane_steps: Vec<PerGroup>,
    /// Sizes and parts of the context model, where planes are coded under one.
    pub context_model: Option<ContextModelShape>,
    /// Width of the deformation network.
    pub network_width: u32,
    /// Depth of the deformation network.
    pub network_depth: u32,
    /// What the deformation network moves.
    pub network_heads: HeadFlags,
    /// Layers of the deformation network.
    pub layer_count: usize,
}

/// One section of a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// Its name.
    pub name: &'static str,
    /// How its numbers are coded.
    pub encoding: Encoding,
    /// Where it begins in the stream.
    pub offset: u64,
    /// Its length.
    pub bytes: u64,
    /// CRC-32C of its bytes.
    pub crc: u32,
}

/// What a stream holds: header, meta, counts, and the size of every section.
///
/// All checksums are checked, so that this is also the quick test of a file for damage.
///
/// # Errors
/// As [`crate::decode`], but for what only decoded numbers can show.
pub fn info(bytes: &[u8]) -> Result<StreamInfo, CodecError> {
    let limits = Limits::default();
    let container = Container::read(bytes, &limits)?;
    meta::check(&container.meta, &limits)?;
    for kind in SectionKind::ALL {
        if container.has(kind) {
            container.section(kind)?;
        }
    }
    let limits = limits.for_stream(bytes.len());
    let open = |kind: SectionKind| {
        container.section(kind).map(|(encoding, payload)| (encoding, Reader::new(kind.name(), payload)))
    };
    let (gaussian_encoding, mut reader) = open(SectionKind::Gaussians)?;
    let gaussian_count = gaussians::Head::read(&mut reader, &limits)?.count;
    let (encoding, mut reader) = open(SectionKind::Sh)?;
    let sh = match encoding {
        Encoding::Float32 => sh::Head::read(&mut reader, &limits)?,
        _ => coded_sh::read_head(&mut reader, &limits)?,
    };
    let (encoding, mut reader) = open(SectionKind::Deformation)?;
    let network = match encoding {
        Encoding::Quantised => deformation::Head::read_coded(&mut reader, &limits)?,
        _ => deformation::Head::read(&mut reader, &limits)?,
    };
    let (encoding, mut reader) = open(SectionKind::HexPlanes)?;
    let (mut plane_bytes, mut plane_steps, mut context_model) = (Vec::new(), Vec::new(), None);
    let hexplane = if encoding == Encoding::Float32 {
        hexplanes::Head::read(&mut reader, &limits)?
    } else {
        let (_, mut model) = open(SectionKind::ContextModel)?;
        let shape = context_model::read_shape(&mut model, &limits)?;
        let (head, bytes) =
            coded_hexplanes::plane_bytes(container.section(SectionKind::HexPlanes)?.1, &shape, &limits)?;
        (plane_bytes, plane_steps, context_model) = (bytes, head.steps, Some(shape));
        head.planes
    };
    let quantised = gaussian_encoding == Encoding::Quantised;
    let profile = if quantised { Profile::Compact } else { Profile::Paper };

    let sections: Vec<_> = container
        .entries
        .iter()
        .map(|entry| SectionInfo {
            name: entry.kind.name(),
            encoding: entry.encoding,
            offset: entry.offset,
            bytes: entry.bytes,
            crc: entry.crc,
        })
        .collect();
    Ok(StreamInfo {
        version: container.prelude.version,
        flags: container.prelude.flags,
        profile: (container.prelude.version > PLAIN_VERSION).then_some(profile),
        bytes: container.prelude.file_bytes,
        header_bytes: container.prelude.file_bytes - sections.iter().map(|section| section.bytes).sum::<u64>(),
        meta: container.meta,
        sections,
        gaussian_count,
        sh_degree: sh.degree,
        hexplane_channels: hexplane.channels,
        hexplane_resolution: hexplane.resolution,
        plane_count: hexplane.plane_count(),
        hexplane_multipliers: hexplane.multipliers,
        plane_bytes,
        plane_steps,
        context_model,
        network_width: network.width,
        network_depth: network.depth,
        network_heads: network.heads,
        layer_count: network.shapes.len(),
    })
}
