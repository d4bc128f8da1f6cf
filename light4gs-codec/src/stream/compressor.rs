//! From a scene to a compressed stream.

use super::{
    Encoded,
    container::NewSection,
    input::{CompressionInput, Profile, check_sh},
    layers::LayerHeads,
    scene_coordinates,
};
use crate::{
    CodecError, FeaturePlaneArrays, GaussianArrays, Limits, MotionArrays, PlaneCoding, SceneData, ShBytes, ShCoding,
    attributes::{self, AttributeInfo, AttributeSteps, EncodedAttributes},
    bytes::{
        Writer,
        sections::{Encoding, Kind},
    },
    motion,
    network_weights::WeightPrecision,
    planes,
    sh::{self, coding::Conditions},
};

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
    let encoded = Compressor::with_limits(scene, input, limits)?.encode(&input.attributes, &input.sh)?;
    encoded.verify(limits)?;
    Ok(encoded)
}

/// Compresses a scene several times with other steps of the Gaussians' attributes. What does not depend on these, the motion
/// and the planes, is coded once.
///
/// Its streams are not decoded again: call [`Encoded::verify`] for one that is kept.
///
/// ```
/// use light4gs_codec::{CompressionInput, Compressor, GaussianLayers, Limits, Profile, SceneData, ShCoding, WeightPrecisions};
/// use light4gs_codec::attributes::AttributeSteps;
///
/// let scene = SceneData::default();
/// let input = CompressionInput {
///     profile: Profile::Compact,
///     planes: None,
///     sh: ShCoding::Channels { step: 0.02 },
///     attributes: AttributeSteps::default(),
///     weights: WeightPrecisions::default(),
///     layers: GaussianLayers::default(),
/// };
/// let compressor = Compressor::new(&scene, &input)?;
/// for step in [0.01, 0.1] {
///     let encoded = compressor.encode(&AttributeSteps::default().with("sh_dc", step), &input.sh)?;
///     println!("{} bytes with a step of {step}", encoded.bytes.len());
///     encoded.verify(&Limits::large())?;
/// }
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Debug)]
pub struct Compressor<'a> {
    scene: &'a SceneData,
    input: &'a CompressionInput,
    limits: Limits,
    shared: Shared,
}

/// What all layers of Gaussians share.
#[derive(Debug)]
struct Shared {
    sections: Vec<NewSection>,
    /// As decoded.
    motion: MotionArrays,
    /// As decoded.
    feature_planes: FeaturePlaneArrays,
    planes: planes::Summary,
}

/// A layer of Gaussians without `sh_rest`.
struct Layer {
    section: NewSection,
    /// The list of the attributes.
    attributes: Vec<AttributeInfo>,
    /// As decoded.
    gaussians: GaussianArrays,
    /// The index of each Gaussian in the given arrays.
    order: Vec<u32>,
}

/// All layers of Gaussians.
#[derive(Default)]
struct Layers {
    sections: Vec<NewSection>,
    /// As decoded.
    gaussians: GaussianArrays,
    heads: LayerHeads,
    sh: ShBytes,
}

impl<'a> Compressor<'a> {
    /// Codes motion, scene coordinates and planes.
    ///
    /// # Errors
    /// As [`encode_compressed`].
    pub fn new(scene: &'a SceneData, input: &'a CompressionInput) -> Result<Self, CodecError> {
        Self::with_limits(scene, input, &Limits::large())
    }

    /// As [`Compressor::new`], within limits of the caller.
    ///
    /// # Errors
    /// As [`encode_compressed`].
    pub fn with_limits(scene: &'a SceneData, input: &'a CompressionInput, limits: &Limits) -> Result<Self, CodecError> {
        input.check(scene, limits)?;
        Ok(Self { scene, input, limits: *limits, shared: Shared::write(scene, input, limits)? })
    }

    /// The stream with these steps of the attributes and this coding of the harmonics, in place of those of the input.
    ///
    /// # Errors
    /// As [`encode_compressed`].
    pub fn encode(&self, steps: &AttributeSteps, sh: &ShCoding) -> Result<Encoded, CodecError> {
        check_sh(self.scene, sh, &self.limits)?;
        let Layers { sections, gaussians, heads, sh } = self.write_layers(steps, sh)?;
        let Shared { motion, feature_planes, planes, .. } = &self.shared;
        let decoded = SceneData {
            meta: self.scene.meta.clone(),
            gaussians,
            coordinates: self.scene.coordinates.clone(),
            feature_planes: feature_planes.clone(),
            motion: motion.clone(),
        };
        Encoded::new(&self.arranged(&sections), decoded, (heads, planes.clone()), sh, &self.limits)
    }

    /// The sections in the order of the stream.
    fn arranged<'s>(&'s self, layers: &'s [NewSection]) -> Vec<&'s NewSection> {
        let mut sections: Vec<_> = self.shared.sections.iter().collect();
        if self.input.layers.count > 1 {
            // What all layers share, and what the planes need before the planes; then layer after layer.
            let place =
                |section: &&NewSection| (section.kind == Kind::FeaturePlanesContextCoded, section.kind.place().0.id());
            sections.sort_by_key(place);
            sections.extend(layers);
        } else {
            sections.extend(layers);
            sections.sort_by_key(|section| section.kind.place().0.id());
        }
        sections
    }

    /// Codes the Gaussians layer by layer, each with its harmonics.
    fn write_layers(&self, steps: &AttributeSteps, sh: &ShCoding) -> Result<Layers, CodecError> {
        let degree = self.scene.gaussians.sh_degree;
        let mut all = Layers::default();
        all.gaussians.sh_degree = degree;
        let mut first = None;
        for Layer { section, attributes, gaussians, order } in self.write_attributes(steps)? {
            let rest = self.scene.gaussians.gathered(&order).sh_rest;
            let with_rest = GaussianArrays { sh_degree: degree, sh_rest: rest, ..gaussians.clone() };
            let (sh_section, written) = self.write_harmonics(&gaussians, &with_rest, sh, &mut first)?;
            let head = attributes::Head { count: with_rest.len() as u32, attributes };
            all.heads.add(head, sh::section::Head::of(&with_rest), self.limits.gaussians)?;
            all.sections.extend([section, sh_section]);
            all.sh.add(&written.bytes);
            let layer = GaussianArrays { sh_rest: written.values, ..with_rest };
            match all.gaussians.is_empty() {
                true => all.gaussians = layer,
                false => all.gaussians.append(layer),
            }
        }
        Ok(all)
    }

    /// Codes the attributes of each layer.
    fn write_attributes(&self, steps: &AttributeSteps) -> Result<Vec<Layer>, CodecError> {
        let gaussians = &self.scene.gaussians;
        let layers = self.input.layers.split(gaussians);
        let section = |encoding, payload| NewSection { kind: Kind::GaussiansExplicit, encoding, payload };
        if self.input.profile == Profile::Compact {
            let coded = attributes::encode_layers(gaussians, steps, &layers)?;
            let layer = |(EncodedAttributes { bytes, order, attributes }, gaussians)| Layer {
                section: section(Encoding::Quantized, bytes),
                attributes,
                gaussians,
                order,
            };
            return Ok(coded.into_iter().map(layer).collect());
        }
        let layer = |order: Vec<u32>| {
            let gaussians = GaussianArrays { sh_degree: 0, sh_rest: Vec::new(), ..gaussians.gathered(&order) };
            let mut writer = Writer::default();
            let attributes = attributes::write_float32(&gaussians, &mut writer);
            Layer { section: section(Encoding::Float32, writer.bytes), attributes, gaussians, order }
        };
        Ok(layers.into_iter().map(layer).collect())
    }

    /// Codes the harmonics of a layer: those of the first one as `sh` says, those of further ones under the tables or networks
    /// of the first, which it leaves in `first`.
    fn write_harmonics(
        &self,
        decoded: &GaussianArrays,
        with_rest: &GaussianArrays,
        sh: &ShCoding,
        first: &mut Option<ShCoding>,
    ) -> Result<(NewSection, sh::section::Written), CodecError> {
        let conditions = Conditions {
            gaussians: decoded,
            coordinates: &self.scene.coordinates,
            feature_planes: &self.shared.feature_planes,
        };
        let mut writer = Writer::default();
        if let Some(coding) = first.as_ref().filter(|coding| !matches!(coding, ShCoding::Channels { .. })) {
            let written = sh::section::write_continued(with_rest, coding, conditions, &mut writer)?;
            let (kind, encoding) = (Kind::ShContinued, Encoding::Quantized);
            return Ok((NewSection { kind, encoding, payload: writer.bytes }, written));
        }
        let precision = self.input.precision(self.input.weights.sh);
        let (written, coding) = sh::section::write(with_rest, sh, precision, conditions, &self.limits, &mut writer)?;
        *first = Some(coding);
        let kind = sh.kind();
        // Harmonics are entropy coded in either profile; in that of the paper, the weights of networks are not.
        let encoding = if kind == Kind::ShNetworks { encoding_of(precision) } else { Encoding::Quantized };
        Ok((NewSection { kind, encoding, payload: writer.bytes }, written))
    }
}

impl Shared {
    fn write(scene: &SceneData, input: &CompressionInput, limits: &Limits) -> Result<Self, CodecError> {
        let mut sections = Vec::new();
        let mut writer = Writer::default();
        let precision = input.precision(input.weights.motion);
        let motion = motion::section::write(&scene.motion, precision, &mut writer)?;
        push(&mut sections, Kind::MotionDescription, encoding_of(precision), writer);
        let mut writer = Writer::default();
        scene_coordinates::write(&scene.coordinates, &mut writer);
        push(&mut sections, scene_coordinates::kind(&scene.coordinates), Encoding::Float32, writer);
        let (feature_planes, planes) = write_planes(&scene.feature_planes, input, limits, &mut sections)?;
        Ok(Self { sections, motion, feature_planes, planes })
    }
}

/// The planes as decoded, and what the stream says of them besides.
fn write_planes(
    feature_planes: &FeaturePlaneArrays,
    input: &CompressionInput,
    limits: &Limits,
    sections: &mut Vec<NewSection>,
) -> Result<(FeaturePlaneArrays, planes::Summary), CodecError> {
    let explicit = planes::Summary::of_explicit(feature_planes)?;
    let mut writer = Writer::default();
    let Some(PlaneCoding { model, steps, latent_symbols }) = &input.planes else {
        planes::explicit::write(feature_planes, &mut writer);
        push(sections, Kind::FeaturePlanesExplicit, Encoding::Float32, writer);
        return Ok((feature_planes.clone(), explicit));
    };
    let precision = input.precision(input.weights.context_model);
    let model = planes::context_section::write(model, precision, &mut writer)?;
    push(sections, Kind::ContextModelNetworks, encoding_of(precision), writer);

    let mut writer = Writer::default();
    let (decoded, bytes) = planes::section::write(feature_planes, &model, steps, latent_symbols, limits, &mut writer)?;
    push(sections, Kind::FeaturePlanesContextCoded, Encoding::Quantized, writer);
    let summary = planes::Summary { bytes, steps: steps.clone(), model: Some(model.into_description()), ..explicit };
    Ok((decoded, summary))
}

fn push(sections: &mut Vec<NewSection>, kind: Kind, encoding: Encoding, writer: Writer) {
    sections.push(NewSection { kind, encoding, payload: writer.bytes });
}

fn encoding_of(precision: Option<WeightPrecision>) -> Encoding {
    if precision.is_some() { Encoding::Quantized } else { Encoding::Float32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Coder, GaussianLayers, OpenStream, WeightPrecisions,
        attributes::{Head, typical_size},
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
                let coded = encode_compressed(&scene, &CompressionInput { layers, ..input.clone() }).expect("a file");
                let sections = &coded.info.sections;
                let of_kind =
                    |of: Section| sections.iter().filter(|s| s.name == of.name()).map(|s| s.bytes).sum::<u64>();
                (of_kind(Section::Gaussians), of_kind(Section::Sh), coded.info.header_bytes)
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
