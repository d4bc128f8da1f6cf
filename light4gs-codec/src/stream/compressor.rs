//! From a scene to a compressed stream.

use super::{
    OpenStream,
    container::{self, NewSection},
    input::{CompressionInput, Profile},
    scene_coordinates,
};
use crate::{
    CodecError, Demand, FeaturePlaneArrays, GaussianArrays, Limits, PlaneBytes, PlaneCoding, SceneData, ShBytes,
    ShCoding,
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
    let layers = write_gaussians(&scene.gaussians, input)?;
    let mut writer = Writer::default();
    let motion = motion::section::write(&scene.motion, compact(input.weights.motion), &mut writer)?;
    push(&mut sections, Kind::MotionDescription, encoding_of(compact(input.weights.motion)), writer);
    let mut writer = Writer::default();
    scene_coordinates::write(&scene.coordinates, &mut writer);
    push(&mut sections, scene_coordinates::kind(&scene.coordinates), Encoding::Float32, writer);
    let precision = compact(input.weights.context_model);
    let (feature_planes, planes) =
        write_planes(&scene.feature_planes, input.planes.as_ref(), precision, limits, &mut sections)?;

    let mut gaussians = GaussianArrays { sh_degree: scene.gaussians.sh_degree, ..GaussianArrays::default() };
    let (mut sh, mut first_coding) = (ShBytes::default(), None);
    let mut layer_sections = Vec::new();
    for Layer { section, attributes, order } in layers {
        layer_sections.push(section);
        let conditions =
            Conditions { gaussians: &attributes, coordinates: &scene.coordinates, feature_planes: &feature_planes };
        let rest = scene.gaussians.gathered(&order).sh_rest;
        let with_rest = GaussianArrays { sh_degree: scene.gaussians.sh_degree, sh_rest: rest, ..attributes.clone() };
        let mut writer = Writer::default();
        let continued = first_coding.as_ref().filter(|coding| !matches!(coding, ShCoding::Channels { .. }));
        let (written, kind, encoding) = match continued {
            Some(coding) => {
                let written = sh::section::write_continued(&with_rest, coding, conditions, &mut writer)?;
                (written, Kind::ShContinued, Encoding::Quantized)
            }
            None => {
                let precision = compact(input.weights.sh);
                let (written, coding) =
                    sh::section::write(&with_rest, &input.sh, precision, conditions, limits, &mut writer)?;
                first_coding = Some(coding);
                let kind = input.sh.kind();
                // Harmonics are entropy coded in either profile; in that of the paper, the weights of networks are not.
                let networks = kind == Kind::ShNetworks;
                (written, kind, if networks { encoding_of(precision) } else { Encoding::Quantized })
            }
        };
        push(&mut layer_sections, kind, encoding, writer);
        sh.add(&written.bytes);
        let layer = GaussianArrays { sh_rest: written.values, ..with_rest };
        match gaussians.is_empty() {
            true => gaussians = layer,
            false => gaussians.append(layer),
        }
    }

    let expected = SceneData {
        meta: scene.meta.clone(),
        gaussians,
        coordinates: scene.coordinates.clone(),
        feature_planes,
        motion,
    };
    if input.layers.count > 1 {
        // What all layers share, and what the planes need before the planes; then layer after layer.
        sections.sort_by_key(|section| (section.kind == Kind::FeaturePlanesContextCoded, section.kind.place().0.id()));
        sections.extend(layer_sections);
    } else {
        sections.extend(layer_sections);
        sections.sort_by_key(|section| section.kind.place().0.id());
    }
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

/// A layer of Gaussians without `sh_rest`.
struct Layer {
    section: NewSection,
    /// As decoded.
    attributes: GaussianArrays,
    /// The index of each Gaussian in the given arrays.
    order: Vec<u32>,
}

fn write_gaussians(gaussians: &GaussianArrays, input: &CompressionInput) -> Result<Vec<Layer>, CodecError> {
    let layers = input.layers.split(gaussians);
    let section = |encoding, payload| NewSection { kind: Kind::GaussiansExplicit, encoding, payload };
    if input.profile == Profile::Compact {
        let coded = attributes::encode_layers(gaussians, &input.attributes, &layers)?;
        let layer = |(EncodedAttributes { bytes, order, .. }, attributes)| Layer {
            section: section(Encoding::Quantized, bytes),
            attributes,
            order,
        };
        return Ok(coded.into_iter().map(layer).collect());
    }
    let layer = |order: Vec<u32>| {
        let attributes = GaussianArrays { sh_degree: 0, sh_rest: Vec::new(), ..gaussians.gathered(&order) };
        let mut writer = Writer::default();
        attributes::write_float32(&attributes, &mut writer);
        Layer { section: section(Encoding::Float32, writer.bytes), attributes, order }
    };
    Ok(layers.into_iter().map(layer).collect())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Coder, GaussianLayers, WeightPrecisions,
        attributes::{AttributeSteps, Head, typical_size},
        bytes::{Reader, Section},
        decode_with_limits, info_with_limits,
    };

    /// The steps of a compact stream.
    fn steps(bytes: &[u8], scene: &SceneData) -> AttributeSteps {
        let info = info_with_limits(bytes, &Limits::large()).expect("a stream");
        let section = info.sections.iter().find(|section| section.name == "gaussians").expect("Gaussians");
        let mut reader = Reader::new("gaussians", &bytes[section.offset as usize..][..section.bytes as usize]);
        let head = Head::read(&mut reader, section.encoding, &Limits::large()).expect("a head");
        let mut steps = AttributeSteps::default();
        for attribute in head.attributes {
            let mut stream = Reader::new("gaussians", reader.take("attribute", attribute.bytes).expect("its bytes"));
            if attribute.coder == Coder::Float32 {
                continue;
            }
            let mut step = 1.0;
            if attribute.coder == Coder::Grid {
                stream.take("corner", 12).expect("a corner");
                step /= typical_size(&scene.gaussians.log_scales);
            }
            steps = steps.with(&attribute.name, step * stream.f32("step").expect("a step"));
        }
        steps
    }

    /// What layers cost: `LIGHT4GS_STREAMS=folder cargo test --release -p light4gs-codec --lib cost_of_layers -- --ignored
    /// --nocapture`. Planes and motion are the same bytes with layers or without, so that only the rest is coded again.
    #[test]
    #[ignore = "needs a folder of streams"]
    fn cost_of_layers() {
        let folder = std::env::var("LIGHT4GS_STREAMS").expect("a folder in LIGHT4GS_STREAMS");
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let bytes = std::fs::read(&path).expect("a file");
            let stream = OpenStream::with_limits(&bytes, &Limits::large()).expect("a stream");
            let (kind, encoding, payload) = stream.container.section(Section::Sh).expect("harmonics");
            let scene = decode_with_limits(&bytes, &Limits::large()).expect("a scene");
            let budget = crate::budget::Budget::new(&Limits::large());
            let features = scene.feature_planes.features();
            let parts = sh::section::Parts::read(payload, (kind, encoding), features, &budget).expect("harmonics");
            let Some(sh) = parts.into_coding() else { continue };
            let input = CompressionInput {
                profile: Profile::Compact,
                planes: None,
                sh: sh.coding,
                attributes: steps(&bytes, &scene),
                weights: WeightPrecisions::default(),
                layers: GaussianLayers::default(),
            };
            let sizes = |count| {
                let layers = GaussianLayers::new(count);
                let coded = encode_compressed_with_limits(
                    &scene,
                    &CompressionInput { layers, ..input.clone() },
                    &Limits::large(),
                );
                let coded = coded.expect("a file");
                let of_kind =
                    |of: Section| coded.report.sections.iter().filter(|s| s.0 == of.name()).map(|s| s.3).sum::<u64>();
                (of_kind(Section::Gaussians), of_kind(Section::Sh), coded.report.header_bytes)
            };
            let (gaussians, sh, header) = sizes(1);
            println!(
                "{}: {} bytes, {} Gaussians; coded again {gaussians} + {sh}",
                path.display(),
                bytes.len(),
                scene.gaussians.len()
            );
            for count in 2..=8 {
                let (layered, layered_sh, layered_header) = sizes(count);
                let more = (layered + layered_sh + layered_header) as f64 - (gaussians + sh + header) as f64;
                println!(
                    "  {count} layers: Gaussians {layered} ({:+.2} %), harmonics {layered_sh} ({:+.2} %), file {:+.2} %",
                    100.0 * (layered as f64 / gaussians as f64 - 1.0),
                    100.0 * (layered_sh as f64 / sh as f64 - 1.0),
                    100.0 * more / bytes.len() as f64
                );
            }
        }
    }
}
