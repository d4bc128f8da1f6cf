//! A scene into a compressed stream.

use crate::{
    CodecError, CompressionInput, Encoding, GaussianArrays, HexPlaneArrays, Limits, NetworkArrays, PlaneBytes, Profile, SceneData,
    ShBytes,
    container::{Builder, VERSION},
    fields,
    harmonics::Conditions,
    sections::{
        SectionKind, coded_hexplanes, coded_sh, context_model, deformation, gaussians, hexplanes, scene_frame, weights,
    },
    stream::{check, decode},
    writer::Writer,
};

/// What [`encode_compressed`] makes.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The stream.
    pub bytes: Vec<u8>,
    /// The scene as [`decode`](crate::decode) gives it, bit for bit.
    pub decoded: SceneData,
    /// Where the bytes went.
    pub report: CompressionReport,
}

/// Where the bytes of a compressed stream went.
#[derive(Clone, Debug, PartialEq)]
pub struct CompressionReport {
    /// Prelude, meta and table.
    pub header_bytes: u64,
    /// Every section: its name, how it is coded, and its bytes.
    pub sections: Vec<(&'static str, Encoding, u64)>,
    /// Every plane, in the order of [`HexPlaneArrays::planes`]; empty where planes are float32.
    pub planes: Vec<PlaneBytes>,
    /// The spherical harmonics.
    pub sh: ShBytes,
}

/// Compresses a scene.
///
/// What is quantised is quantised here, and every network is used as the stream holds it. The stream is decoded again and
/// compared, bit by bit, with what the encoder expects before it is returned.
///
/// # Errors
/// What [`crate::encode`] refuses; a model, tables or layers that contradict themselves or the scene; values beyond ±2^22 steps. The
/// message names the section and the field.
pub fn encode_compressed(scene: &SceneData, input: &CompressionInput) -> Result<Encoded, CodecError> {
    let limits = Limits::default();
    check(scene, &limits)?;
    let precision = precision_of(input);

    let mut sections = Vec::new();
    let (attributes, order) = write_gaussians(scene, input, &mut sections)?;
    let network = write_network(&scene.deformation, precision, &limits, &mut sections)?;
    let mut frame = Writer::default();
    scene_frame::write(&scene.frame, &mut frame);
    sections.push((SectionKind::SceneFrame, Encoding::Float32, frame.bytes));
    let (hexplane, planes) = write_planes(scene, input, precision, &limits, &mut sections)?;

    let conditions = Conditions { gaussians: &attributes, frame: &scene.frame, hexplane: &hexplane };
    let rest = reordered(&scene.gaussians, &order);
    let with_rest = GaussianArrays { sh_degree: scene.gaussians.sh_degree, sh_rest: rest, ..attributes.clone() };
    let mut writer = Writer::default();
    let (sh_rest, sh) = coded_sh::write(&with_rest, &input.sh, precision, conditions, &mut writer)?;
    sections.push((SectionKind::Sh, input.sh.encoding(), writer.bytes));

    let expected = SceneData {
        meta: scene.meta.clone(),
        gaussians: GaussianArrays { sh_rest, ..with_rest },
        frame: scene.frame.clone(),
        hexplane,
        deformation: network,
    };
    sections.sort_by_key(|(kind, ..)| kind.id());
    let mut builder = Builder::new(VERSION, sections.len(), &scene.meta, &limits)?;
    for (kind, encoding, payload) in &sections {
        builder.section(*kind, *encoding, |writer| writer.bytes.extend_from_slice(payload));
    }
    let bytes = builder.finish();

    let decoded = decode(&bytes)?;
    fields::check_same_bits(&expected, &decoded)?;
    let sections: Vec<_> = sections
        .into_iter()
        .map(|(kind, encoding, payload)| (kind.name(), encoding, payload.len() as u64))
        .collect();
    let header_bytes = bytes.len() as u64 - sections.iter().map(|section| section.2).sum::<u64>();
    Ok(Encoded { bytes, decoded, report: CompressionReport { header_bytes, sections, planes, sh } })
}

type Sections = Vec<(SectionKind, Encoding, Vec<u8>)>;

fn precision_of(input: &CompressionInput) -> Option<weights::Precision> {
    (input.profile == Profile::Compact).then_some(12)
}

/// The attributes but for `sh_rest`, as decoded, and which of the given Gaussians each of them was.
fn write_gaussians(
    scene: &SceneData,
    _input: &CompressionInput,
    sections: &mut Sections,
) -> Result<(GaussianArrays, Vec<u32>), CodecError> {
    let given = GaussianArrays { sh_degree: 0, sh_rest: Vec::new(), ..scene.gaussians.clone() };
    let mut writer = Writer::default();
    gaussians::write(&given, &mut writer);
    sections.push((SectionKind::Gaussians, Encoding::Float32, writer.bytes));
    let order = (0..given.len() as u32).collect();
    Ok((given, order))
}

/// The deformation network as decoded.
fn write_network(
    network: &NetworkArrays,
    _precision: Option<weights::Precision>,
    _limits: &Limits,
    sections: &mut Sections,
) -> Result<NetworkArrays, CodecError> {
    let mut writer = Writer::default();
    deformation::write(network, &mut writer);
    sections.push((SectionKind::Deformation, Encoding::Float32, writer.bytes));
    Ok(network.clone())
}

/// The planes as decoded, and what each of them takes.
fn write_planes(
    scene: &SceneData,
    input: &CompressionInput,
    precision: Option<weights::Precision>,
    limits: &Limits,
    sections: &mut Sections,
) -> Result<(HexPlaneArrays, Vec<PlaneBytes>), CodecError> {
    let mut writer = Writer::default();
    let Some(coding) = &input.planes else {
        hexplanes::write(&scene.hexplane, &mut writer);
        sections.push((SectionKind::HexPlanes, Encoding::Float32, writer.bytes));
        return Ok((scene.hexplane.clone(), Vec::new()));
    };
    coding.model.check(limits)?;
    coded_hexplanes::check(&scene.hexplane, &coding.model.shape, &coding.steps, &coding.hyper_symbols)?;
    context_model::write(&coding.model, precision, &mut writer)?;
    let model = context_model::read(&writer.bytes, precision.is_some(), limits)?;
    let encoding = if precision.is_some() { Encoding::Quantised } else { Encoding::Float32 };
    sections.push((SectionKind::ContextModel, encoding, writer.bytes));

    let mut writer = Writer::default();
    let decoded =
        coded_hexplanes::write(&scene.hexplane, &model, &coding.steps, &coding.hyper_symbols, &mut writer)?;
    let (_, planes) = coded_hexplanes::plane_bytes(&writer.bytes, &model.shape, limits)?;
    sections.push((SectionKind::HexPlanes, Encoding::ContextCoded, writer.bytes));
    Ok((decoded, planes))
}

/// `sh_rest` in the order of the stream.
fn reordered(gaussians: &GaussianArrays, order: &[u32]) -> Vec<f32> {
    let channels = gaussians.sh_rest.len() / gaussians.len().max(1);
    order.iter().flat_map(|&index| &gaussians.sh_rest[index as usize * channels..][..channels]).copied().collect()
}
