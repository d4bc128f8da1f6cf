//! What a stream holds, without decoding its numbers.

use crate::{
    CodecError, Encoding, HeadFlags, Limits, SceneMeta,
    container::Container,
    reader::Reader,
    sections::{SectionKind, deformation, gaussians, hexplanes, meta, sh},
};

/// What a stream holds.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamInfo {
    /// Version of the format.
    pub version: u16,
    /// Flags of the header; version 1 has none.
    pub flags: u16,
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
    let reader = |kind: SectionKind| container.section(kind).map(|(_, payload)| Reader::new(kind.name(), payload));
    let gaussians = gaussians::Head::read(&mut reader(SectionKind::Gaussians)?, &limits)?;
    let sh = sh::Head::read(&mut reader(SectionKind::Sh)?, &limits)?;
    let hexplane = hexplanes::Head::read(&mut reader(SectionKind::HexPlanes)?, &limits)?;
    let network = deformation::Head::read(&mut reader(SectionKind::Deformation)?, &limits)?;

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
        bytes: container.prelude.file_bytes,
        header_bytes: container.prelude.file_bytes - sections.iter().map(|section| section.bytes).sum::<u64>(),
        meta: container.meta,
        sections,
        gaussian_count: gaussians.count,
        sh_degree: sh.degree,
        hexplane_channels: hexplane.channels,
        hexplane_resolution: hexplane.resolution,
        plane_count: hexplane.plane_count(),
        hexplane_multipliers: hexplane.multipliers,
        network_width: network.width,
        network_depth: network.depth,
        network_heads: network.heads,
        layer_count: network.shapes.len(),
    })
}
