//! The planes of the multiscale hexplane.

use super::{SectionKind, check_length};
use crate::{CodecError, HexPlaneArrays, Limits, Plane, limits::at_most, reader::Reader, writer::Writer};

const SECTION: &str = SectionKind::HexPlanes.name();
/// The axes of the planes of a scale, as indices into x, y, z, t.
pub(crate) const AXES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
const AXIS_NAMES: [char; 4] = ['x', 'y', 'z', 't'];
const TIME: usize = 3;

/// What stands before the numbers.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) channels: u32,
    pub(crate) resolution: [u32; 4],
    pub(crate) multipliers: Vec<u32>,
    /// Height and width of each plane.
    pub(super) sizes: Vec<[u32; 2]>,
}

impl Head {
    pub(super) fn of(hexplane: &HexPlaneArrays) -> Self {
        Self {
            channels: hexplane.channels,
            resolution: hexplane.resolution,
            multipliers: hexplane.multipliers.clone(),
            sizes: hexplane.planes.iter().map(|plane| [plane.height, plane.width]).collect(),
        }
    }

    pub(crate) fn plane_count(&self) -> usize {
        self.sizes.len()
    }

    pub(crate) fn read(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let channels = reader.u32("channels")?;
        let mut resolution = [0; 4];
        for samples in &mut resolution {
            *samples = reader.u32("resolution")?;
        }
        let scales = reader.u32("number of scales")?;
        at_most(SECTION, "number of scales", scales.into(), limits.scales)?;
        reader.demand("scales", u64::from(scales) * (4 + 6 * 8))?;
        let multipliers = (0..scales).map(|_| reader.u32("multipliers")).collect::<Result<_, _>>()?;
        let planes = u64::from(scales) * AXES.len() as u64;
        let sizes = (0..planes)
            .map(|_| Ok([reader.u32("height")?, reader.u32("width")?]))
            .collect::<Result<_, CodecError>>()?;
        let head = Self { channels, resolution, multipliers, sizes };
        head.check(limits)?;
        Ok(head)
    }

    fn write(&self, writer: &mut Writer) {
        writer.u32(self.channels);
        for samples in self.resolution {
            writer.u32(samples);
        }
        writer.u32(self.multipliers.len() as u32);
        for &multiplier in &self.multipliers {
            writer.u32(multiplier);
        }
        for &[height, width] in &self.sizes {
            writer.u32(height);
            writer.u32(width);
        }
    }

    /// Refuses sizes that do not follow from the resolution and the multipliers.
    pub(super) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        at_most(SECTION, "channels", self.channels.into(), limits.channels)?;
        at_most(SECTION, "number of scales", self.multipliers.len() as u64, limits.scales)?;
        for (axis, samples) in self.resolution.into_iter().enumerate() {
            at_most(SECTION, format!("resolution along {}", AXIS_NAMES[axis]), samples.into(), limits.resolution)?;
        }
        let expected = AXES.len() as u64 * self.multipliers.len() as u64;
        check_length(SECTION, "planes", self.sizes.len(), expected, "6 for each multiplier")?;
        if !self.sizes.is_empty() && self.channels == 0 {
            return Err(CodecError::invalid(SECTION, "channels", 0, "1 or more where there are planes"));
        }
        for (index, &[height, width]) in self.sizes.iter().enumerate() {
            let (a, b) = AXES[index % AXES.len()];
            let multiplier = self.multipliers[index / AXES.len()];
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
        let legal = u64::from(found) == multiplied || axis == TIME && u64::from(found) == base;
        if found > 0 && legal {
            return Ok(());
        }
        let name = AXIS_NAMES[axis];
        let mut expected = format!("{multiplied} (resolution {base} along {name} times multiplier {multiplier})");
        if axis == TIME {
            expected += &format!(" or {base}");
        }
        if multiplied == 0 {
            expected += ", and more than 0";
        }
        Err(CodecError::invalid(SECTION, field, found, expected))
    }

    /// Numbers of one plane.
    pub(super) fn values(&self, [height, width]: [u32; 2]) -> u64 {
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
    Ok(())
}

pub(crate) fn write(hexplane: &HexPlaneArrays, writer: &mut Writer) {
    Head::of(hexplane).write(writer);
    for plane in &hexplane.planes {
        writer.f32s(&plane.values);
    }
}

pub(crate) fn read(bytes: &[u8], limits: &Limits) -> Result<HexPlaneArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let head = Head::read(&mut reader, limits)?;
    let mut planes = Vec::with_capacity(head.sizes.len());
    for (index, &[height, width]) in head.sizes.iter().enumerate() {
        let values = reader.f32s(&format!("planes[{index}].values"), head.values([height, width]))?;
        planes.push(Plane { height, width, values });
    }
    reader.finish()?;
    let Head { channels, resolution, multipliers, .. } = head;
    Ok(HexPlaneArrays { channels, resolution, multipliers, planes })
}
