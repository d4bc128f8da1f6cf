//! From a scene to a compressed stream.

use super::{
    OpenStream,
    container::{self, NewSection},
    input::{CompressionInput, Profile},
    scene_coordinates,
};
use crate::{
    CodecError, Demand, FeaturePlaneArrays, GaussianArrays, Limits, PlaneBytes, PlaneCoding, SceneData, ShBytes,
    attributes::{self, EncodedAttributes},
    bytes::{
        Writer,
        sections::{Encoding, Kind},
    },
    fields, motion,
    network_weights::WeightPrecision,
    planes,
    sh::{self, coding::Conditions},
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
    /// Every section: its name, its kind, its encoding, and its bytes.
    pub sections: Vec<(&'static str, Kind, Encoding, u64)>,
    /// Every plane, in the order of [`FeaturePlaneArrays::planes`]; empty where planes are float32.
    pub planes: Vec<PlaneBytes>,
    /// The spherical harmonics.
    pub sh: ShBytes,
    /// What a reader must allow to decode the stream.
    pub demand: Demand,
}

/// Compresses a scene.
///
/// Quantization takes place here, and every network is used as the stream holds it. Before the stream is returned, it
/// is decoded again and compared, bit by bit, with what the encoder expects.
///
/// # Errors
/// What [`crate::encode`] refuses; a model, tables or layers that contradict themselves or the scene; values beyond
/// ±2^22 steps. The message names the section and the field.
pub fn encode_compressed(scene: &SceneData, input: &CompressionInput) -> Result<Encoded, CodecError> {
    encode_compressed_with_limits(scene, input, &Limits::large())
}

/// As [`encode_compressed`], within limits of the caller: those of the readers that the stream is for.
///
/// # Errors
/// As [`encode_compressed`].
pub fn encode_compressed_with_limits(
    scene: &SceneData,
    input: &CompressionInput,
    limits: &Limits,
) -> Result<Encoded, CodecError> {
    input.check(scene, limits)?;
    let compact = |precision| (input.profile == Profile::Compact).then_some(precision);

    let mut sections = Vec::new();
    let (attributes, order) = write_gaussians(&scene.gaussians, input, &mut sections)?;
    let mut writer = Writer::default();
    let motion = motion::section::write(&scene.motion, compact(input.weights.motion), &mut writer)?;
    push(&mut sections, Kind::MotionDescription, encoding_of(compact(input.weights.motion)), writer);
    let mut writer = Writer::default();
    scene_coordinates::write(&scene.coordinates, &mut writer);
    push(&mut sections, scene_coordinates::kind(&scene.coordinates), Encoding::Float32, writer);
    let precision = compact(input.weights.context_model);
    let (feature_planes, planes) =
        write_planes(&scene.feature_planes, input.planes.as_ref(), precision, limits, &mut sections)?;

    let conditions =
        Conditions { gaussians: &attributes, coordinates: &scene.coordinates, feature_planes: &feature_planes };
    let rest = reordered(&scene.gaussians, &order);
    let with_rest = GaussianArrays { sh_degree: scene.gaussians.sh_degree, sh_rest: rest, ..attributes.clone() };
    let mut writer = Writer::default();
    let precision = compact(input.weights.sh);
    let (sh_rest, sh) = sh::section::write(&with_rest, &input.sh, precision, conditions, limits, &mut writer)?;
    let kind = input.sh.kind();
    // Harmonics are entropy coded in either profile; in that of the paper, the weights of networks are not.
    let encoding = if kind == Kind::ShNetworks { encoding_of(precision) } else { Encoding::Quantized };
    push(&mut sections, kind, encoding, writer);

    let expected = SceneData {
        meta: scene.meta.clone(),
        gaussians: GaussianArrays { sh_rest, ..with_rest },
        coordinates: scene.coordinates.clone(),
        feature_planes,
        motion,
    };
    sections.sort_by_key(|section| section.kind.place().0.id());
    let bytes = container::write(&scene.meta, &sections, limits)?;

    let (decoded, demand) = OpenStream::with_limits(&bytes, limits)?.scene_and_demand()?;
    fields::check_same_bits(&expected, &decoded)?;
    let size = |section: NewSection| {
        let NewSection { kind, encoding, payload } = section;
        (kind.place().0.name(), kind, encoding, payload.len() as u64)
    };
    let sections: Vec<_> = sections.into_iter().map(size).collect();
    let header_bytes = bytes.len() as u64 - sections.iter().map(|section| section.3).sum::<u64>();
    Ok(Encoded { bytes, decoded, report: CompressionReport { header_bytes, sections, planes, sh, demand } })
}

fn push(sections: &mut Vec<NewSection>, kind: Kind, encoding: Encoding, writer: Writer) {
    sections.push(NewSection { kind, encoding, payload: writer.bytes });
}

fn encoding_of(precision: Option<WeightPrecision>) -> Encoding {
    if precision.is_some() { Encoding::Quantized } else { Encoding::Float32 }
}

/// The attributes without `sh_rest`, as decoded, and the index of each Gaussian in the given arrays.
fn write_gaussians(
    gaussians: &GaussianArrays,
    input: &CompressionInput,
    sections: &mut Vec<NewSection>,
) -> Result<(GaussianArrays, Vec<u32>), CodecError> {
    if input.profile == Profile::Compact {
        let EncodedAttributes { bytes, order, .. } = attributes::encode(gaussians, &input.attributes)?;
        push(sections, Kind::GaussiansExplicit, Encoding::Quantized, Writer { bytes });
        return Ok((attributes::quantized(gaussians, &input.attributes)?, order));
    }
    let mut writer = Writer::default();
    attributes::write_float32(gaussians, &mut writer);
    push(sections, Kind::GaussiansExplicit, Encoding::Float32, writer);
    let order = (0..gaussians.len() as u32).collect();
    Ok((GaussianArrays { sh_degree: 0, sh_rest: Vec::new(), ..gaussians.clone() }, order))
}

/// The planes as decoded, and the bytes of each.
fn write_planes(
    feature_planes: &FeaturePlaneArrays,
    coding: Option<&PlaneCoding>,
    precision: Option<WeightPrecision>,
    limits: &Limits,
    sections: &mut Vec<NewSection>,
) -> Result<(FeaturePlaneArrays, Vec<PlaneBytes>), CodecError> {
    let mut writer = Writer::default();
    let Some(PlaneCoding { model, steps, latent_symbols }) = coding else {
        planes::explicit::write(feature_planes, &mut writer);
        push(sections, Kind::FeaturePlanesExplicit, Encoding::Float32, writer);
        return Ok((feature_planes.clone(), Vec::new()));
    };
    let model = planes::context_section::write(model, precision, &mut writer)?;
    push(sections, Kind::ContextModelNetworks, encoding_of(precision), writer);

    let mut writer = Writer::default();
    let decoded = planes::section::write(feature_planes, &model, steps, latent_symbols, limits, &mut writer)?;
    let (_, planes) = planes::section::plane_bytes(&writer.bytes, &model, limits)?;
    push(sections, Kind::FeaturePlanesContextCoded, Encoding::Quantized, writer);
    Ok((decoded, planes))
}

/// `sh_rest` in the order of the stream.
fn reordered(gaussians: &GaussianArrays, order: &[u32]) -> Vec<f32> {
    let channels = gaussians.sh_rest.len() / gaussians.len().max(1);
    order.iter().flat_map(|&index| &gaussians.sh_rest[index as usize * channels..][..channels]).copied().collect()
}
