//! A scene into a compressed stream.

use crate::{
    CodecError, CompressionInput, Encoding, GaussianArrays, HexPlaneArrays, Limits, NetworkArrays, PlaneBytes,
    PlaneCoding, Profile, SceneData, ShBytes,
    attributes::{self, EncodedAttributes},
    container::{Builder, VERSION},
    fields,
    harmonics::Conditions,
    network_weights::WeightPrecision,
    sections::{SectionKind, coded_hexplanes, coded_sh, context_model, deformation, gaussians, hexplanes, scene_frame},
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
/// What is quantised is quantised here, and every network is used as the stream holds it. The stream is decoded again
/// and compared, bit by bit, with what the encoder expects before it is returned.
///
/// # Errors
/// What [`crate::encode`] refuses; a model, tables or layers that contradict themselves or the scene; values beyond
/// ±2^22 steps. The message names the section and the field.
pub fn encode_compressed(scene: &SceneData, input: &CompressionInput) -> Result<Encoded, CodecError> {
    let limits = Limits::default();
    check(scene, &limits)?;
    let compact = |precision| (input.profile == Profile::Compact).then_some(precision);

    let mut sections = Vec::new();
    let (attributes, order) = write_gaussians(&scene.gaussians, input, &mut sections)?;
    let network = write_network(&scene.deformation, input, &mut sections)?;
    let mut frame = Writer::default();
    scene_frame::write(&scene.frame, &mut frame);
    sections.push((SectionKind::SceneFrame, Encoding::Float32, frame.bytes));
    let (hexplane, planes) = write_planes(
        &scene.hexplane,
        input.planes.as_ref(),
        compact(input.weights.context_model),
        &limits,
        &mut sections,
    )?;

    let conditions = Conditions { gaussians: &attributes, frame: &scene.frame, hexplane: &hexplane };
    let rest = reordered(&scene.gaussians, &order);
    let with_rest = GaussianArrays { sh_degree: scene.gaussians.sh_degree, sh_rest: rest, ..attributes.clone() };
    let mut writer = Writer::default();
    let (sh_rest, sh) = coded_sh::write(&with_rest, &input.sh, compact(input.weights.sh), conditions, &mut writer)?;
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
    let sections: Vec<_> =
        sections.into_iter().map(|(kind, encoding, payload)| (kind.name(), encoding, payload.len() as u64)).collect();
    let header_bytes = bytes.len() as u64 - sections.iter().map(|section| section.2).sum::<u64>();
    Ok(Encoded { bytes, decoded, report: CompressionReport { header_bytes, sections, planes, sh } })
}

type Sections = Vec<(SectionKind, Encoding, Vec<u8>)>;

/// The attributes but for `sh_rest`, as decoded, and which of the given Gaussians each of them was.
fn write_gaussians(
    gaussians: &GaussianArrays,
    input: &CompressionInput,
    sections: &mut Sections,
) -> Result<(GaussianArrays, Vec<u32>), CodecError> {
    if input.profile == Profile::Compact {
        let EncodedAttributes { bytes, order, .. } = attributes::encode(gaussians, &input.attributes)?;
        sections.push((SectionKind::Gaussians, Encoding::Quantised, bytes));
        return Ok((attributes::quantised(gaussians, &input.attributes)?, order));
    }
    let mut writer = Writer::default();
    gaussians::write(gaussians, &mut writer);
    sections.push((SectionKind::Gaussians, Encoding::Float32, writer.bytes));
    let order = (0..gaussians.len() as u32).collect();
    Ok((GaussianArrays { sh_degree: 0, sh_rest: Vec::new(), ..gaussians.clone() }, order))
}

/// The deformation network as decoded.
fn write_network(
    network: &NetworkArrays,
    input: &CompressionInput,
    sections: &mut Sections,
) -> Result<NetworkArrays, CodecError> {
    let mut writer = Writer::default();
    let (encoding, decoded) = match input.profile {
        Profile::Compact => {
            let decoded = deformation::write_coded(network, input.weights.deformation, &mut writer)?;
            (Encoding::Quantised, decoded)
        }
        Profile::Paper => {
            deformation::write(network, &mut writer);
            (Encoding::Float32, network.clone())
        }
    };
    sections.push((SectionKind::Deformation, encoding, writer.bytes));
    Ok(decoded)
}

/// The planes as decoded, and what each of them takes.
fn write_planes(
    hexplane: &HexPlaneArrays,
    coding: Option<&PlaneCoding>,
    precision: Option<WeightPrecision>,
    limits: &Limits,
    sections: &mut Sections,
) -> Result<(HexPlaneArrays, Vec<PlaneBytes>), CodecError> {
    let mut writer = Writer::default();
    let Some(PlaneCoding { model, steps, hyper_symbols }) = coding else {
        hexplanes::write(hexplane, &mut writer);
        sections.push((SectionKind::HexPlanes, Encoding::Float32, writer.bytes));
        return Ok((hexplane.clone(), Vec::new()));
    };
    model.check(limits)?;
    coded_hexplanes::check(hexplane, &model.shape, steps, hyper_symbols)?;
    let model = context_model::write(model, precision, &mut writer)?;
    let encoding = if precision.is_some() { Encoding::Quantised } else { Encoding::Float32 };
    sections.push((SectionKind::ContextModel, encoding, writer.bytes));

    let mut writer = Writer::default();
    let decoded = coded_hexplanes::write(hexplane, &model, steps, hyper_symbols, &mut writer)?;
    let (_, planes) = coded_hexplanes::plane_bytes(&writer.bytes, &model.shape, limits)?;
    sections.push((SectionKind::HexPlanes, Encoding::ContextCoded, writer.bytes));
    Ok((decoded, planes))
}

/// `sh_rest` in the order of the stream.
fn reordered(gaussians: &GaussianArrays, order: &[u32]) -> Vec<f32> {
    let channels = gaussians.sh_rest.len() / gaussians.len().max(1);
    order.iter().flat_map(|&index| &gaussians.sh_rest[index as usize * channels..][..channels]).copied().collect()
}
