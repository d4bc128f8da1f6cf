//! Every number of a scene by name: whether it is finite, and whether two scenes agree to the bit.

use std::slice::from_ref;

use crate::{AttributeValues, CodecError, GaussianArrays, SceneData, bytes::Section, scene::SH_REST};

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

    add("meta", "fps".into(), from_ref(&meta.fps));
    add("meta", "bounds".into(), meta.bounds.as_flattened());
    add("meta", "background".into(), &meta.background);
    add("meta", "fov_x".into(), from_ref(&meta.fov_x));

    of_gaussians(gaussians).for_each(|Field { section, name, values }| add(section, name, values));

    let section = Section::SceneCoordinates.name();
    add(section, "mean".into(), &coordinates.mean);
    add(section, "axes".into(), coordinates.axes.as_flattened());
    add(section, "std".into(), &coordinates.std);
    add(section, "scale".into(), &coordinates.mapping.scale);
    add(section, "offset".into(), &coordinates.mapping.offset);
    add(section, "time_scale".into(), from_ref(&coordinates.mapping.time_scale));
    add(section, "time_offset".into(), from_ref(&coordinates.mapping.time_offset));

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
