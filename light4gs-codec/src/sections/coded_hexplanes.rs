//! Hexplanes under a context model: sizes, steps, and a sub-stream for each part of each plane.

use super::{SectionKind, hexplanes};
use crate::{
    CodecError, ContextModelArrays, ContextModelShape, HexPlaneArrays, Limits, PerGroup, Plane,
    limits::at_most,
    planes::{self, PlanePlan},
    reader::Reader,
    writer::Writer,
};

const SECTION: &str = SectionKind::HexPlanes.name();
const TIME: usize = 3;

/// What stands before the sub-streams.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) planes: hexplanes::Head,
    pub(crate) steps: Vec<PerGroup>,
}

/// Bytes of one plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneBytes {
    /// Position among [`HexPlaneArrays::planes`].
    pub plane: usize,
    /// Of the hyperprior.
    pub hyperprior: u64,
    /// Of the anchors, the checkerboard's first half.
    pub anchors: u64,
    /// Of the other values: the second half, or all.
    pub others: u64,
}

impl PlaneBytes {
    /// All of the plane's bytes.
    pub fn total(&self) -> u64 {
        self.hyperprior + self.anchors + self.others
    }
}

/// Refuses what cannot be coded: planes, steps and hyperprior symbols that contradict the model or each other.
pub(crate) fn check(
    hexplane: &HexPlaneArrays,
    model: &ContextModelShape,
    steps: &[PerGroup],
    hyper_symbols: &[Vec<i32>],
) -> Result<(), CodecError> {
    check_model(&hexplanes::Head::of(hexplane), model)?;
    check_steps(steps, hexplane.multipliers.len())?;
    if multiplied_time(hexplane).is_none() {
        let found = "multiplied in some planes of a scale";
        return Err(CodecError::invalid(SECTION, "time axis", found, "the same in all planes of a scale"));
    }
    let plans = planes::plan(model, hexplane.multipliers.len());
    if hyper_symbols.len() != plans.len() {
        let expected = format!("{}, one list a plane", plans.len());
        return Err(CodecError::invalid(SECTION, "lists of hyperprior symbols", hyper_symbols.len(), expected));
    }
    for (index, (plan, symbols)) in plans.iter().zip(hyper_symbols).enumerate() {
        let Plane { height, width, .. } = hexplane.planes[index];
        let area = u64::from(height / 4) * u64::from(width / 4);
        let expected = if plan.has_hyperprior() { u64::from(model.hyper_channels) * area } else { 0 };
        if symbols.len() as u64 != expected {
            let field = format!("number of hyperprior symbols of planes[{index}]");
            return Err(CodecError::invalid(SECTION, field, symbols.len(), expected.to_string()));
        }
    }
    Ok(())
}

/// Refuses channels other than the model's, and sizes that are no multiples of 4.
fn check_model(head: &hexplanes::Head, model: &ContextModelShape) -> Result<(), CodecError> {
    if head.channels != model.channels {
        let expected = format!("{}, those of the context model", model.channels);
        return Err(CodecError::invalid(SECTION, "channels", head.channels, expected));
    }
    for (index, size) in head.sizes.iter().enumerate() {
        if let Some(side) = size.iter().find(|side| !side.is_multiple_of(4)) {
            return Err(CodecError::invalid(SECTION, format!("a side of planes[{index}]"), side, "a multiple of 4"));
        }
    }
    Ok(())
}

fn check_steps(steps: &[PerGroup], scales: usize) -> Result<(), CodecError> {
    if steps.len() != 1 && steps.len() != scales {
        let expected = format!("1, or {scales}, one a scale");
        return Err(CodecError::invalid(SECTION, "number of steps", steps.len(), expected));
    }
    let bad = steps.iter().flat_map(|step| [step.space_only, step.space_time]).find(|&step| !is_step(step));
    match bad {
        Some(step) => Err(CodecError::invalid(SECTION, "step", step, "a positive normal number")),
        None => Ok(()),
    }
}

fn is_step(step: f32) -> bool {
    step.is_normal() && step > 0.0
}

/// For each scale, whether time is multiplied as space is; nothing where the planes of a scale differ.
fn multiplied_time(hexplane: &HexPlaneArrays) -> Option<u64> {
    let mut bits = 0;
    for (scale, planes) in hexplane.planes.chunks_exact(6).enumerate() {
        let base = hexplane.resolution[TIME];
        let time = [2, 4, 5].map(|kind| planes[kind].height);
        if time[1..].iter().any(|&height| height != time[0]) {
            return None;
        }
        bits |= u64::from(time[0] != base) << scale;
    }
    Some(bits)
}

impl Head {
    pub(crate) fn read(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let channels = reader.varint_at_most("channels", limits.channels)?;
        let mut resolution = [0; 4];
        for samples in &mut resolution {
            *samples = reader.varint_at_most("resolution", limits.resolution)?;
        }
        let scales = reader.varint_at_most("number of scales", limits.scales)?;
        let multipliers = (0..scales)
            .map(|_| reader.varint_at_most("multipliers", limits.resolution))
            .collect::<Result<Vec<_>, _>>()?;
        let bits = reader.varint("scales with multiplied time")?;
        let mut sizes = Vec::new();
        for (scale, &multiplier) in multipliers.iter().enumerate() {
            for (first, second) in hexplanes::AXES {
                let side = |axis: usize| {
                    let multiplied = axis != TIME || bits >> scale & 1 == 1;
                    resolution[axis].saturating_mul(if multiplied { multiplier } else { 1 })
                };
                sizes.push([side(second), side(first)]);
            }
        }
        let has_meaning = |scale: usize| multipliers[scale] != 1 && resolution[TIME] != 0;
        if bits >> scales != 0 || (0..scales as usize).any(|scale| bits >> scale & 1 == 1 && !has_meaning(scale)) {
            let field = "scales with multiplied time";
            return Err(CodecError::invalid(
                SECTION,
                field,
                format!("{bits:#b}"),
                "bits of scales whose multiplier is not 1",
            ));
        }
        let planes = hexplanes::Head { channels, resolution, multipliers, sizes };
        planes.check(limits)?;
        let count = reader.varint_at_most("number of steps", limits.scales)?;
        let mut steps = Vec::new();
        for _ in 0..count {
            steps.push(PerGroup { space_only: reader.f32("step")?, space_time: reader.f32("step")? });
        }
        check_steps(&steps, scales as usize)?;
        Ok(Self { planes, steps })
    }
}

fn write_head(hexplane: &HexPlaneArrays, steps: &[PerGroup], writer: &mut Writer) {
    writer.varint(hexplane.channels.into());
    for samples in hexplane.resolution {
        writer.varint(samples.into());
    }
    writer.varint(hexplane.multipliers.len() as u64);
    for &multiplier in &hexplane.multipliers {
        writer.varint(multiplier.into());
    }
    writer.varint(multiplied_time(hexplane).expect("`check` has looked at the time axis"));
    writer.varint(steps.len() as u64);
    for step in steps {
        writer.f32s(&[step.space_only, step.space_time]);
    }
}

/// Writes planes that [`check`] has passed; returns them as a decoder gets them.
pub(crate) fn write(
    hexplane: &HexPlaneArrays,
    model: &ContextModelArrays,
    steps: &[PerGroup],
    hyper_symbols: &[Vec<i32>],
    writer: &mut Writer,
) -> Result<HexPlaneArrays, CodecError> {
    write_head(hexplane, steps, writer);
    let planes::CodedPlanes { sub_streams, decoded } = planes::encode(hexplane, model, steps, hyper_symbols)?;
    for stream in &sub_streams {
        writer.varint(stream.len() as u64);
    }
    for stream in &sub_streams {
        writer.bytes.extend_from_slice(stream);
    }
    Ok(decoded)
}

/// A section taken apart.
struct Parts<'a> {
    head: Head,
    plans: Vec<PlanePlan>,
    sub_streams: Vec<&'a [u8]>,
}

impl<'a> Parts<'a> {
    fn read(bytes: &'a [u8], model: &ContextModelShape, limits: &Limits) -> Result<Self, CodecError> {
        let mut reader = Reader::new(SECTION, bytes);
        let head = Head::read(&mut reader, limits)?;
        check_model(&head.planes, model)?;
        let plans = planes::plan(model, head.planes.multipliers.len());
        let count: usize = plans.iter().map(PlanePlan::sub_streams).sum();
        let lengths = (0..count).map(|_| reader.varint("length of a sub-stream")).collect::<Result<Vec<_>, _>>()?;
        let take = |length| reader.take("sub-stream", length);
        let sub_streams = lengths.into_iter().map(take).collect::<Result<_, _>>()?;
        reader.finish()?;
        Ok(Self { head, plans, sub_streams })
    }
}

pub(crate) fn read(bytes: &[u8], model: &ContextModelArrays, limits: &Limits) -> Result<HexPlaneArrays, CodecError> {
    let Parts { head: Head { planes: head, steps }, sub_streams, .. } = Parts::read(bytes, &model.shape, limits)?;
    let values = head.sizes.iter().fold(0u64, |sum, &size| sum.saturating_add(head.values(size)));
    at_most(SECTION, "number of values", values, limits.coded_values)?;
    let positions = values / u64::from(head.channels.max(1));
    // The widest map between two networks, at the size of all planes.
    let [a, b] = model.shape.synthesis_channels;
    let widest = if model.shape.parts.hyperprior { b.max(a.div_ceil(4)) } else { 0 };
    let map = positions.saturating_mul(widest.into());
    at_most(SECTION, "number of values between two layers", map, 2 * limits.coded_values)?;
    let work = positions.saturating_mul(model.shape.weights());
    at_most(SECTION, "number of multiplications", work, limits.multiplications)?;

    let hexplanes::Head { channels, resolution, multipliers, sizes } = head;
    let planes = sizes.iter().map(|&[height, width]| Plane { height, width, values: Vec::new() }).collect();
    planes::decode(HexPlaneArrays { channels, resolution, multipliers, planes }, model, &steps, &sub_streams)
}

/// Bytes of every plane, without decoding.
pub(crate) fn plane_bytes(
    bytes: &[u8],
    model: &ContextModelShape,
    limits: &Limits,
) -> Result<(Head, Vec<PlaneBytes>), CodecError> {
    let Parts { head, plans, sub_streams } = Parts::read(bytes, model, limits)?;
    let mut planes: Vec<_> = planes::stream_order(&plans)
        .into_iter()
        .map(|(plane, first)| {
            let plan = &plans[plane];
            let mut lengths = sub_streams[first..].iter().map(|stream| stream.len() as u64);
            let mut part = |present: bool| if present { lengths.next().unwrap_or(0) } else { 0 };
            let (hyperprior, anchors) = (part(plan.has_hyperprior()), part(plan.checkerboard));
            PlaneBytes { plane, hyperprior, anchors, others: part(true) }
        })
        .collect();
    planes.sort_by_key(|plane| plane.plane);
    Ok((head, planes))
}
