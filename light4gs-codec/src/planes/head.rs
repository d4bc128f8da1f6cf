//! The head of the section: which planes there are, and their sizes.

use crate::{
    CodecError, FeaturePlaneArrays, Limits,
    bytes::{Reader, Section, Writer, check_length},
    limits::at_most,
    plane_layout::{AXIS_NAMES, PlaneAxes, PlaneLayout, PlaneShape},
};

pub(super) const SECTION: &str = Section::FeaturePlanes.name();
/// The bit of a scale whose planes differ in size along a common axis.
const OWN_SIZES: u8 = 1 << PlaneAxes::ALL.len();

/// Channels and planes.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) channels: u32,
    pub(crate) layout: PlaneLayout,
}

impl Head {
    pub(crate) fn of(planes: &FeaturePlaneArrays) -> Result<Self, CodecError> {
        Ok(Self { channels: planes.channels, layout: planes.layout()? })
    }

    /// For planes that [`check`] has accepted.
    pub(super) fn of_checked(planes: &FeaturePlaneArrays) -> Self {
        Self::of(planes).expect("`check` has looked at the order")
    }

    pub(crate) fn read(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let channels = reader.varint_at_most("channels", limits.channels)?;
        let scales = reader.varint_at_most("number of scales", limits.scales)?;
        let mut planes = Vec::new();
        for scale in 0..scales as usize {
            let bits = reader.u8("planes of a scale")?;
            let has = |axes: &PlaneAxes| bits >> *axes as u8 & 1 == 1;
            let own: Vec<PlaneAxes> = PlaneAxes::ALL.into_iter().filter(has).collect();
            if own.is_empty() || bits > OWN_SIZES | (OWN_SIZES - 1) {
                let (field, found) = (format!("planes of scale {scale}"), format!("{bits:#010b}"));
                return Err(CodecError::invalid(SECTION, field, found, "a bit for each of xy, xz, xt, yz, yt, zt"));
            }
            let mut side = |name: &str| Ok::<_, CodecError>(reader.varint_at_most(name, limits.resolution)? as usize);
            let first = planes.len();
            if bits & OWN_SIZES != 0 {
                for axes in own {
                    let (width, height) = (side("width of a plane")?, side("height of a plane")?);
                    planes.push(PlaneShape { scale, axes, size: [height, width] });
                }
                if cells(&planes[first..]).is_some() {
                    let field = format!("sizes of scale {scale}");
                    let expected = "cells along each axis, where the planes agree about them";
                    return Err(CodecError::invalid(SECTION, field, "one for each plane", expected));
                }
            } else {
                let mut cells = [0; AXIS_NAMES.len()];
                for (axis, cells) in cells.iter_mut().enumerate() {
                    if own.iter().any(|axes| axes.axes().contains(&axis)) {
                        *cells = side("cells along an axis")?;
                    }
                }
                let shape = |axes: PlaneAxes| {
                    let [a, b] = axes.axes();
                    PlaneShape { scale, axes, size: [cells[b], cells[a]] }
                };
                planes.extend(own.into_iter().map(shape));
            }
        }
        let layout = PlaneLayout::new(planes).expect("scales and bits are read in the order of a layout");
        let head = Self { channels, layout };
        head.check(limits)?;
        Ok(head)
    }

    /// Writes a head that [`Head::check`] has accepted.
    pub(crate) fn write(&self, writer: &mut Writer) {
        writer.varint(self.channels.into());
        writer.varint(self.layout.scales() as u64);
        for scale in 0..self.layout.scales() {
            let planes = &self.layout.planes()[self.layout.scale(scale)];
            let bits = planes.iter().fold(0, |bits, plane| bits | 1 << plane.axes as u8);
            match cells(planes) {
                Some(cells) => {
                    writer.bytes.push(bits);
                    cells.into_iter().flatten().for_each(|cells| writer.varint(cells as u64));
                }
                None => {
                    writer.bytes.push(bits | OWN_SIZES);
                    let sides = planes.iter().flat_map(|PlaneShape { size: [height, width], .. }| [width, height]);
                    sides.for_each(|&side| writer.varint(side as u64));
                }
            }
        }
    }

    /// Refuses planes beyond the limits, or without values.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        at_most(SECTION, "channels", self.channels.into(), limits.channels)?;
        at_most(SECTION, "number of scales", self.layout.scales() as u64, limits.scales)?;
        if !self.layout.is_empty() && self.channels == 0 {
            return Err(CodecError::invalid(SECTION, "channels", 0, "1 or more where there are planes"));
        }
        for plane in self.layout.planes() {
            for (side, name) in plane.size.into_iter().zip(["height", "width"]) {
                let field = format!("{name} of plane {}", plane.name());
                at_most(SECTION, field.as_str(), side as u64, limits.resolution)?;
                if side == 0 {
                    return Err(CodecError::invalid(SECTION, field, 0, "1 or more"));
                }
            }
        }
        Ok(())
    }

    /// Numbers of one plane.
    pub(crate) fn values(&self, [height, width]: [usize; 2]) -> u64 {
        u64::from(self.channels).saturating_mul(height as u64).saturating_mul(width as u64)
    }
}

/// The size along each axis that planes of a scale span; `None` where planes differ.
fn cells(planes: &[PlaneShape]) -> Option<[Option<usize>; AXIS_NAMES.len()]> {
    let mut cells = [None; AXIS_NAMES.len()];
    for plane in planes {
        let [height, width] = plane.size;
        for (axis, side) in plane.axes.axes().into_iter().zip([width, height]) {
            if *cells[axis].get_or_insert(side) != side {
                return None;
            }
        }
    }
    Some(cells)
}

/// Refuses planes that are out of order, beyond the limits, or whose length does not follow from their size.
pub(crate) fn check(planes: &FeaturePlaneArrays, limits: &Limits) -> Result<(), CodecError> {
    let head = Head::of(planes)?;
    head.check(limits)?;
    for (plane, shape) in planes.planes.iter().zip(head.layout.planes()) {
        let why = format!("{} channels, height {}, width {}", head.channels, plane.height, plane.width);
        check_length(
            SECTION,
            format!("values of plane {}", shape.name()),
            plane.values.len(),
            head.values(shape.size),
            &why,
        )?;
    }
    Ok(())
}
