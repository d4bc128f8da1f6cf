//! Planes with a context model: sizes, steps, and a sub-stream for each part of each plane.

use super::{
    coder::{self, CodedPlanes},
    head::{Head, SECTION},
    plan::{stream_order, sub_streams},
    summary::Summary,
};
use crate::{
    CodecError, ContextModelArrays, FeaturePlaneArrays, Limits, PerGroup, PlaneCoding,
    budget::Budget,
    bytes::{Reader, Writer},
    plane_layout::{PlaneLayout, SIZE_MULTIPLE},
    steps::{LEAST_STEP_IN_STREAM, plane_step},
};

/// A sub-stream in messages.
const SUB_STREAM: &str = "sub-stream";

/// Bytes of one plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneBytes {
    /// Position among [`FeaturePlaneArrays::planes`].
    pub plane: usize,
    /// Of the latent.
    pub latent: u64,
    /// Of the anchors, where they come first.
    pub anchors: u64,
    /// Of the other values, or all.
    pub others: u64,
}

impl PlaneBytes {
    /// All of the plane's bytes.
    pub fn total(&self) -> u64 {
        self.latent + self.anchors + self.others
    }
}

/// Refuses a model that is illegal or beyond the limits, and planes, steps and latents that contradict it or each
/// other.
pub(crate) fn check(planes: &FeaturePlaneArrays, coding: &PlaneCoding, limits: &Limits) -> Result<(), CodecError> {
    let PlaneCoding { model, steps, latent_symbols } = coding;
    model.check(limits)?;
    let head = Head::of(planes)?;
    check_model(&head, model)?;
    check_steps(steps, head.layout.scales())?;
    steps.iter().flat_map(|step| [step.space_only, step.space_time]).try_for_each(plane_step)?;
    if latent_symbols.len() != head.layout.len() {
        let expected = format!("{}, one list a plane", head.layout.len());
        return Err(CodecError::invalid(SECTION, "lists of latent symbols", latent_symbols.len(), expected));
    }
    let latents = model.have_latents().into_iter().zip(latent_symbols);
    for (plane, (has_latent, symbols)) in head.layout.planes().iter().zip(latents) {
        let area = plane.size.into_iter().map(|side| side as u64 / 4).product::<u64>();
        let expected = if has_latent { u64::from(model.latent_channels()) * area } else { 0 };
        if symbols.len() as u64 != expected {
            let field = format!("number of latent symbols of plane {}", plane.name());
            return Err(CodecError::invalid(SECTION, field, symbols.len(), expected.to_string()));
        }
    }
    coder::check_cost(&head.layout, model, limits)
}

/// Refuses planes that do not fit the model, and sizes that a latent or a checkerboard cannot have.
fn check_model(head: &Head, model: &ContextModelArrays) -> Result<(), CodecError> {
    if head.channels != model.channels {
        let expected = format!("{}, those of the context model", model.channels);
        return Err(CodecError::invalid(SECTION, "channels", head.channels, expected));
    }
    for plane in head.layout.planes() {
        if let Some(side) = plane.size.iter().find(|side| !side.is_multiple_of(SIZE_MULTIPLE)) {
            let expected = format!("a multiple of {SIZE_MULTIPLE}");
            return Err(CodecError::invalid(SECTION, format!("a side of plane {}", plane.name()), side, expected));
        }
    }
    model.check_planes(&head.layout)
}

fn check_steps(steps: &[PerGroup], scales: usize) -> Result<(), CodecError> {
    if steps.len() != 1 && steps.len() != scales {
        let expected = format!("1, or {scales}, one a scale");
        return Err(CodecError::invalid(SECTION, "number of steps", steps.len(), expected));
    }
    let is_step = |step: f32| step.is_finite() && step >= LEAST_STEP_IN_STREAM;
    match steps.iter().flat_map(|step| [step.space_only, step.space_time]).find(|&step| !is_step(step)) {
        Some(step) => Err(CodecError::invalid(SECTION, "step", step, "a number of 2^-60 or more")),
        None => Ok(()),
    }
}

/// Writes planes that [`check`] has accepted; returns them as a decoder gets them, and the bytes of each.
pub(crate) fn write(
    planes: &FeaturePlaneArrays,
    model: &ContextModelArrays,
    steps: &[PerGroup],
    latent_symbols: &[Vec<i32>],
    limits: &Limits,
    writer: &mut Writer,
) -> Result<(FeaturePlaneArrays, Vec<PlaneBytes>), CodecError> {
    let head = Head::of_checked(planes);
    head.write(writer);
    writer.varint(steps.len() as u64);
    steps.iter().for_each(|step| writer.f32s(&[step.space_only, step.space_time]));
    let CodedPlanes { sub_streams, decoded } = coder::encode(planes, model, steps, latent_symbols, limits)?;
    sub_streams.iter().for_each(|stream| writer.varint(stream.len() as u64));
    sub_streams.iter().for_each(|stream| writer.bytes.extend_from_slice(stream));
    let lengths: Vec<u64> = sub_streams.iter().map(|stream| stream.len() as u64).collect();
    Ok((decoded, plane_bytes(&lengths, model, &head.layout)))
}

/// The parts of a section before its sub-streams.
struct Parts {
    head: Head,
    steps: Vec<PerGroup>,
    /// Bytes of each sub-stream.
    lengths: Vec<u64>,
}

impl Parts {
    fn read(reader: &mut Reader<'_>, model: &ContextModelArrays, limits: &Limits) -> Result<Self, CodecError> {
        let head = Head::read(reader, limits)?;
        check_model(&head, model)?;
        let scales = head.layout.scales();
        let count = reader.varint_at_most("number of steps", limits.scales)?;
        let steps = (0..count)
            .map(|_| Ok(PerGroup { space_only: reader.f32("step")?, space_time: reader.f32("step")? }))
            .collect::<Result<Vec<_>, CodecError>>()?;
        check_steps(&steps, scales)?;
        let count: usize = (0..head.layout.len()).map(|plane| sub_streams(model, plane)).sum();
        let lengths = (0..count).map(|_| reader.varint("length of a sub-stream")).collect::<Result<_, _>>()?;
        Ok(Self { head, steps, lengths })
    }

    /// All but the values. `model` may be a description.
    fn summary(self, model: ContextModelArrays) -> Summary {
        let Self { head, steps, lengths } = self;
        let bytes = plane_bytes(&lengths, &model, &head.layout);
        Summary { head, bytes, steps, model: Some(model.into_description()) }
    }
}

/// Reads the planes, and what the stream says of them besides.
pub(crate) fn read(
    bytes: &[u8],
    model: ContextModelArrays,
    budget: &Budget,
) -> Result<(FeaturePlaneArrays, Summary), CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let parts = Parts::read(&mut reader, &model, &budget.limits)?;
    let take = |&length| reader.take(SUB_STREAM, length);
    let sub_streams = parts.lengths.iter().map(take).collect::<Result<Vec<_>, _>>()?;
    reader.finish()?;
    let planes = coder::decode(&parts.head.layout, &model, &parts.steps, &sub_streams, budget)?;
    Ok((planes, parts.summary(model)))
}

/// What the stream says of the planes, without decoding. `beginning` is that of the section, which has a `length` in bytes.
/// The weights of the model are not needed.
pub(crate) fn read_summary(
    beginning: &[u8],
    length: u64,
    model: ContextModelArrays,
    limits: &Limits,
) -> Result<Summary, CodecError> {
    let mut reader = Reader::new(SECTION, beginning);
    let parts = Parts::read(&mut reader, &model, limits)?;
    let mut available = length - (beginning.len() - reader.rest().len()) as u64;
    for &needed in &parts.lengths {
        available = available.checked_sub(needed).ok_or_else(|| {
            let field = SUB_STREAM.to_owned();
            CodecError::Truncated { section: SECTION, field, needed, available }
        })?;
    }
    match available {
        0 => Ok(parts.summary(model)),
        bytes => Err(CodecError::TrailingBytes { section: SECTION, bytes }),
    }
}

/// The bytes of each plane, in the order of the planes, from those of the sub-streams in the order of the stream.
fn plane_bytes(lengths: &[u64], model: &ContextModelArrays, layout: &PlaneLayout) -> Vec<PlaneBytes> {
    let of_plane = |(plane, first): (usize, usize)| {
        let prior = model.prior(plane);
        let mut lengths = lengths[first..].iter().copied();
        let mut part = |present: bool| if present { lengths.next().unwrap_or(0) } else { 0 };
        let (latent, anchors) = (part(prior.has_latent()), part(prior.has_anchors()));
        PlaneBytes { plane, latent, anchors, others: part(true) }
    };
    let mut planes: Vec<_> = stream_order(model, layout).into_iter().map(of_plane).collect();
    planes.sort_by_key(|plane| plane.plane);
    planes
}
