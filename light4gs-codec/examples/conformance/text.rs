//! The text that the conformance set compares: checksums of all arrays of a scene or a take, a line each. See
//! tests/conformance/README.md.

use light4gs_codec::{
    CodecError, CoordinateMapping, GaussianArrays, Limits, MotionEvaluator, SceneData, decode, info,
    take::{DrawnSegment, SegmentPart, SegmentTimes, Take, TakeSegment, drawn_together, is_take},
};

/// The lines of a stream or a take. Times are numbers as text; they stand in the lines as they are given. Those of a take are
/// seconds.
pub(crate) fn lines(bytes: &[u8], times: &[&str]) -> Result<Vec<String>, CodecError> {
    if is_take(bytes) {
        return take_lines(bytes, times);
    }
    let scene = decode(bytes)?;
    let evaluator = MotionEvaluator::new(&scene)?;
    let mut lines = Vec::new();
    scene_lines("scene", &scene, &mut lines);
    for time in times {
        let number = time.parse().expect("a time is a number");
        frame(time, &moved(&scene, &evaluator, number), &mut lines);
    }
    Ok(lines)
}

/// The times of the segments, the base, each segment, and what is drawn at each time.
fn take_lines(bytes: &[u8], times: &[&str]) -> Result<Vec<String>, CodecError> {
    let take = Take::read(bytes.to_vec(), &Limits::default())?;
    let mut numbers = Vec::new();
    for place in take.index().segments() {
        let SegmentTimes { begin, end, stream_begin, stream_end, frames } = place.times;
        numbers.extend([begin, end, stream_begin, stream_end].iter().flat_map(|time| time.to_le_bytes()));
        numbers.extend(frames.to_le_bytes());
    }
    let mut lines = vec![format!("take times {:08x}", crc32c::crc32c(&numbers))];
    let stream = take.base()?;
    take.index().check_base(&info(&stream)?)?;
    let base = decode(&stream)?;
    MotionEvaluator::new(&base)?;
    scene_lines("base", &base, &mut lines);
    let mut segments = Vec::new();
    for number in 0..take.len() {
        let TakeSegment { times, stream, hidden } = take.segment(number)?;
        let scene = decode(&stream)?;
        let evaluator = MotionEvaluator::new(&scene)?;
        let bits: Vec<u8> = hidden.iter().map(|&bit| bit.into()).collect();
        lines.push(format!("segment-{number} hidden {:08x}", crc32c::crc32c(&bits)));
        scene_lines(&format!("segment-{number}"), &scene, &mut lines);
        segments.push((times, scene, evaluator, hidden));
    }
    for time in times {
        let seconds = time.parse().expect("a time is a number");
        let parts = take.drawn_at(seconds).into_iter().map(|DrawnSegment { segment, weight }| {
            let (times, scene, evaluator, hidden) = &segments[segment];
            (hidden, moved(scene, evaluator, times.stream_time(seconds)), weight)
        });
        let parts: Vec<_> = parts.collect();
        let parts: Vec<_> =
            parts.iter().map(|(hidden, moved, weight)| SegmentPart { hidden, moved, weight: *weight }).collect();
        let drawn = drawn_together(&base.gaussians, &parts);
        frame(time, &drawn, &mut lines);
    }
    Ok(lines)
}

fn moved(scene: &SceneData, evaluator: &MotionEvaluator, time: f32) -> GaussianArrays {
    let mut moved = scene.gaussians.clone();
    evaluator.apply(&scene.gaussians, time, 0..moved.len(), &mut moved);
    moved
}

/// The lines of a decoded stream, without times.
fn scene_lines(what: &str, scene: &SceneData, lines: &mut Vec<String>) {
    for attribute in scene.gaussians.attributes() {
        lines.push(line(what, attribute.name, attribute.values));
    }
    lines.push(line(what, "coordinates", &coordinates(scene)));
    let planes: Vec<f32> = scene.feature_planes.planes.iter().flat_map(|plane| plane.values.clone()).collect();
    lines.push(line(what, "planes", &planes));
    lines.push(line(what, "motion", &motion(scene)));
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
