//! The sizes of the planes of a multiscale hexplane.

use crate::{
    CodecError, HexPlaneArrays, Limits,
    bytes::{Reader, Section, Writer, check_length},
    limits::at_most,
    plane_layout::{AXIS_NAMES, PLANE_AXES, TIME_AXIS},
};

pub(super) const SECTION: &str = Section::HexPlanes.name();

/// What stands before the numbers.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) channels: u32,
    pub(crate) resolution: [u32; 4],
    pub(crate) multipliers: Vec<u32>,
    /// Height and width of each plane.
    pub(crate) sizes: Vec<[u32; 2]>,
}

impl Head {
    pub(crate) fn of(hexplane: &HexPlaneArrays) -> Self {
        Self {
            channels: hexplane.channels,
            resolution: hexplane.resolution,
            multipliers: hexplane.multipliers.clone(),
            sizes: hexplane.planes.iter().map(|plane| [plane.height, plane.width]).collect(),
        }
    }

    /// Of planes whose time axis is not multiplied.
    pub(crate) fn from_shape(channels: u32, resolution: [u32; 4], multipliers: &[u32]) -> Self {
        let side = |axis: usize, multiplier: u32| match axis {
            TIME_AXIS => resolution[axis],
            _ => resolution[axis].saturating_mul(multiplier),
        };
        let sizes = multipliers
            .iter()
            .flat_map(|&multiplier| PLANE_AXES.map(|[a, b]| [side(b, multiplier), side(a, multiplier)]));
        Self { channels, resolution, multipliers: multipliers.to_vec(), sizes: sizes.collect() }
    }

    pub(crate) fn plane_count(&self) -> usize {
        self.sizes.len()
    }

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
            for [first, second] in PLANE_AXES {
                let side = |axis: usize| {
                    let multiplied = axis != TIME_AXIS || is_set(bits, scale);
                    resolution[axis].saturating_mul(if multiplied { multiplier } else { 1 })
                };
                sizes.push([side(second), side(first)]);
            }
        }
        let has_meaning = |scale: usize| multipliers[scale] != 1 && resolution[TIME_AXIS] != 0;
        if bits.checked_shr(scales).unwrap_or(0) != 0
            || (0..scales as usize).any(|scale| is_set(bits, scale) && !has_meaning(scale))
        {
            let (field, found) = ("scales with multiplied time", format!("{bits:#b}"));
            return Err(CodecError::invalid(SECTION, field, found, "bits of scales whose multiplier is not 1"));
        }
        let head = Self { channels, resolution, multipliers, sizes };
        head.check(limits)?;
        Ok(head)
    }

    /// Writes the head of planes that [`check`] has passed.
    pub(crate) fn write(hexplane: &HexPlaneArrays, writer: &mut Writer) {
        writer.varint(hexplane.channels.into());
        for samples in hexplane.resolution {
            writer.varint(samples.into());
        }
        writer.varint(hexplane.multipliers.len() as u64);
        for &multiplier in &hexplane.multipliers {
            writer.varint(multiplier.into());
        }
        writer.varint(multiplied_time(hexplane).unwrap_or(0));
    }

    /// Refuses sizes that do not follow from the resolution and the multipliers.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        at_most(SECTION, "channels", self.channels.into(), limits.channels)?;
        at_most(SECTION, "number of scales", self.multipliers.len() as u64, limits.scales)?;
        for (axis, samples) in self.resolution.into_iter().enumerate() {
            at_most(SECTION, format!("resolution along {}", AXIS_NAMES[axis]), samples.into(), limits.resolution)?;
        }
        let expected = PLANE_AXES.len() as u64 * self.multipliers.len() as u64;
        check_length(SECTION, "planes", self.sizes.len(), expected, "6 for each multiplier")?;
        if !self.sizes.is_empty() && self.channels == 0 {
            return Err(CodecError::invalid(SECTION, "channels", 0, "1 or more where there are planes"));
        }
        for (index, &[height, width]) in self.sizes.iter().enumerate() {
            let [a, b] = PLANE_AXES[index % PLANE_AXES.len()];
            let multiplier = self.multipliers[index / PLANE_AXES.len()];
            self.check_side(&format!("planes[{index}].width"), width, a, multiplier, limits)?;
            self.check_side(&format!("planes[{index}].height"), height, b, multiplier, limits)?;
        }
        Ok(())
    }

    /// A spatial axis is multiplied, time may be.
    fn check_side(
        &self,
        field: &str,
        found: u32,
        axis: usize,
        multiplier: u32,
        limits: &Limits,
    ) -> Result<(), CodecError> {
        at_most(SECTION, field, found.into(), limits.resolution)?;
        let base = u64::from(self.resolution[axis]);
        let multiplied = base * u64::from(multiplier);
        let legal = u64::from(found) == multiplied || axis == TIME_AXIS && u64::from(found) == base;
        if found > 0 && legal {
            return Ok(());
        }
        let name = AXIS_NAMES[axis];
        let mut expected = format!("{multiplied} (resolution {base} along {name} times multiplier {multiplier})");
        if axis == TIME_AXIS {
            expected += &format!(" or {base}");
        }
        if multiplied == 0 {
            expected += ", and more than 0";
        }
        Err(CodecError::invalid(SECTION, field, found, expected))
    }

    /// Numbers of one plane.
    pub(crate) fn values(&self, [height, width]: [u32; 2]) -> u64 {
        u64::from(self.channels).saturating_mul(u64::from(height)).saturating_mul(u64::from(width))
    }
}

/// Refuses planes whose sizes or lengths do not follow from the head.
pub(crate) fn check(hexplane: &HexPlaneArrays, limits: &Limits) -> Result<(), CodecError> {
    let head = Head::of(hexplane);
    head.check(limits)?;
    for (index, (plane, &size)) in hexplane.planes.iter().zip(&head.sizes).enumerate() {
        let why = format!("{} channels, height {}, width {}", head.channels, plane.height, plane.width);
        check_length(SECTION, format!("planes[{index}].values"), plane.values.len(), head.values(size), &why)?;
    }
    if multiplied_time(hexplane).is_none() {
        let found = "multiplied in some planes of a scale";
        return Err(CodecError::invalid(SECTION, "time axis", found, "the same in all planes of a scale"));
    }
    Ok(())
}

/// A bit for each scale whose time axis is multiplied, lowest first; none where planes of a scale disagree.
fn multiplied_time(hexplane: &HexPlaneArrays) -> Option<u64> {
    let mut bits = 0;
    let scales = hexplane.planes.chunks_exact(PLANE_AXES.len()).zip(&hexplane.multipliers);
    for (scale, (planes, &multiplier)) in scales.enumerate() {
        let times: Vec<u32> = planes
            .iter()
            .zip(PLANE_AXES)
            .filter(|(_, axes)| axes[1] == TIME_AXIS)
            .map(|(plane, _)| plane.height)
            .collect();
        if times.iter().any(|&time| time != times[0]) {
            return None;
        }
        let multiplied = times[0] != hexplane.resolution[TIME_AXIS] && multiplier != 1;
        bits |= u64::from(multiplied) << scale;
    }
    Some(bits)
}

fn is_set(bits: u64, bit: usize) -> bool {
    bits.checked_shr(bit as u32).unwrap_or(0) & 1 == 1
}
