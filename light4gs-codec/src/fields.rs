//! Every number of a scene by name: whether it is finite, and whether two scenes agree to the bit.

use std::slice::from_ref;

use crate::{
    AttributeValues, CodecError, GaussianArrays, SceneCoordinateArrays, SceneData, SceneMeta, bytes::Section,
    scene::SH_REST,
};

/// One array of numbers of a scene.
struct Field<'a> {
    section: &'static str,
    name: String,
    values: &'a [f32],
}

/// All numbers of `scene`, in the order of the stream.
fn fields(scene: &SceneData) -> Vec<Field<'_>> {
    let SceneData { meta, gaussians, coordinates, feature_planes, motion } = scene;
    let mut fields = Vec::new();
    let mut add = |section, name: String, values| fields.push(Field { section, name, values });

    of_meta(meta).into_iter().for_each(|Field { section, name, values }| add(section, name, values));
    of_gaussians(gaussians).for_each(|Field { section, name, values }| add(section, name, values));

    of_coordinates(coordinates).into_iter().for_each(|Field { section, name, values }| add(section, name, values));

    let section = Section::Motion.name();
    let layers = motion.network.iter().flat_map(|motion| motion.network.layers());
    for (index, layer) in layers.enumerate() {
        add(section, format!("layers[{index}].weight"), &layer.weight);
        add(section, format!("layers[{index}].bias"), &layer.bias);
    }
    for tensor in &motion.tensors {
        add(section, tensor.name.clone(), &tensor.values);
    }

    let section = Section::FeaturePlanes.name();
    for plane in &feature_planes.planes {
        add(section, format!("values of plane {}", plane.shape().name()), &plane.values);
    }
    fields
}

fn of_meta(meta: &SceneMeta) -> [Field<'_>; 4] {
    [
        ("fps", from_ref(&meta.fps)),
        ("bounds", meta.bounds.as_flattened()),
        ("background", &meta.background),
        ("fov_x", from_ref(&meta.fov_x)),
    ]
    .map(|(name, values)| Field { section: "meta", name: name.to_owned(), values })
}

fn of_coordinates(coordinates: &SceneCoordinateArrays) -> [Field<'_>; 7] {
    let mapping = &coordinates.mapping;
    [
        ("mean", &coordinates.mean[..]),
        ("axes", coordinates.axes.as_flattened()),
        ("std", &coordinates.std),
        ("scale", &mapping.scale),
        ("offset", &mapping.offset),
        ("time_scale", from_ref(&mapping.time_scale)),
        ("time_offset", from_ref(&mapping.time_offset)),
    ]
    .map(|(name, values)| Field { section: Section::SceneCoordinates.name(), name: name.to_owned(), values })
}

fn of_gaussians(gaussians: &GaussianArrays) -> impl Iterator<Item = Field<'_>> {
    gaussians.attributes().map(|AttributeValues { name, values, .. }| {
        let section = if name == SH_REST { Section::Sh } else { Section::Gaussians };
        Field { section: section.name(), name: name.to_owned(), values }
    })
}

/// Refuses NaN and infinities.
pub(crate) fn check_finite(scene: &SceneData) -> Result<(), CodecError> {
    check_all_finite(fields(scene))
}

/// As [`check_finite`], for the meta alone.
pub(crate) fn check_finite_meta(meta: &SceneMeta) -> Result<(), CodecError> {
    check_all_finite(of_meta(meta))
}

/// As [`check_finite`], for the scene coordinates alone.
pub(crate) fn check_finite_coordinates(coordinates: &SceneCoordinateArrays) -> Result<(), CodecError> {
    check_all_finite(of_coordinates(coordinates))
}

/// As [`check_finite`], for Gaussians alone.
pub(crate) fn check_finite_gaussians(gaussians: &GaussianArrays) -> Result<(), CodecError> {
    check_all_finite(of_gaussians(gaussians))
}

fn check_all_finite<'a>(fields: impl IntoIterator<Item = Field<'a>>) -> Result<(), CodecError> {
    for Field { section, name, values } in fields {
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return Err(CodecError::NonFinite { section, field: name, index, value: values[index] });
        }
    }
    Ok(())
}

/// Refuses a `decoded` scene that differs from the `given` one in any bit.
pub(crate) fn check_same_bits(given: &SceneData, decoded: &SceneData) -> Result<(), CodecError> {
    for (a, b) in fields(given).into_iter().zip(fields(decoded)) {
        let same =
            a.values.len() == b.values.len() && a.values.iter().zip(b.values).all(|(x, y)| x.to_bits() == y.to_bits());
        if !same {
            return Err(CodecError::SelfCheck { section: a.section, field: a.name });
        }
    }
    // Names, counts and shapes. Numbers have been found equal, except arrays that one side lacks.
    if given != decoded {
        return Err(CodecError::SelfCheck { section: "stream", field: "a name, a count or a shape".into() });
    }
    Ok(())
}
