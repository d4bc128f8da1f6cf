//! The text that the conformance set compares: checksums of all arrays of a scene, a line each. See
//! tests/conformance/README.md.

use light4gs_codec::{CodecError, CoordinateMapping, GaussianArrays, MotionEvaluator, SceneData, decode};

/// The lines of a stream. Times are numbers as text; they stand in the lines as they are given.
pub(crate) fn lines(bytes: &[u8], times: &[&str]) -> Result<Vec<String>, CodecError> {
    let scene = decode(bytes)?;
    let evaluator = MotionEvaluator::new(&scene)?;
    let mut lines = Vec::new();
    for attribute in scene.gaussians.attributes() {
        lines.push(line("scene", attribute.name, attribute.values));
    }
    lines.push(line("scene", "coordinates", &coordinates(&scene)));
    let planes: Vec<f32> = scene.feature_planes.planes.iter().flat_map(|plane| plane.values.clone()).collect();
    lines.push(line("scene", "planes", &planes));
    lines.push(line("scene", "motion", &motion(&scene)));
    for time in times {
        let mut moved = scene.gaussians.clone();
        let number = time.parse().expect("a time is a number");
        evaluator.apply(&scene.gaussians, number, 0..moved.len(), &mut moved);
        frame(time, &moved, &mut lines);
    }
    Ok(lines)
}

/// The lines of one time.
fn frame(time: &str, gaussians: &GaussianArrays, lines: &mut Vec<String>) {
    let mut all = Vec::new();
    for attribute in gaussians.attributes() {
        lines.push(line(time, attribute.name, attribute.values));
        all.extend(attribute.values);
    }
    lines.push(line(time, "all", &all));
}

fn coordinates(scene: &SceneData) -> Vec<f32> {
    let coordinates = &scene.coordinates;
    let CoordinateMapping { contracts, scale, offset, time_scale, time_offset } = coordinates.mapping;
    let mut values = coordinates.mean.to_vec();
    values.extend(coordinates.axes.as_flattened());
    values.extend(coordinates.std);
    values.push(f32::from(u8::from(contracts)));
    values.extend(scale);
    values.extend(offset);
    values.extend([time_scale, time_offset]);
    values
}

/// The weights of the network, and then the tensors.
fn motion(scene: &SceneData) -> Vec<f32> {
    let mut values = Vec::new();
    for layer in scene.motion.network.iter().flat_map(|motion| motion.network.layers()) {
        values.extend(&layer.weight);
        values.extend(&layer.bias);
    }
    values.extend(scene.motion.tensors.iter().flat_map(|tensor| &tensor.values));
    values
}

fn line(what: &str, array: &str, values: &[f32]) -> String {
    let checksum = values.iter().fold(0, |crc, value| crc32c::crc32c_append(crc, &value.to_le_bytes()));
    format!("{what} {array} {checksum:08x}")
}
