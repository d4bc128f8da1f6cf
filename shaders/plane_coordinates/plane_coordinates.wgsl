// Coordinates of the planes of points.
//
// One invocation owns one point. Reads `points` [N, 3], `mean`, `axes` (axis j in column j) and `deviations`; writes `coordinates`
// [N, width].

// #include contraction

@group(0) @binding(0) var<storage, read_write> points: array<f32>;
@group(0) @binding(1) var<storage, read_write> mean: array<f32>;
@group(0) @binding(2) var<storage, read_write> axes: array<f32>;
@group(0) @binding(3) var<storage, read_write> deviations: array<f32>;
@group(0) @binding(4) var<storage, read_write> coordinates: array<f32>;
@group(0) @binding(5) var<uniform> mapping: Mapping;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= mapping.count) {
        return;
    }
    let at = 3u * i;
    let point = vec3<f32>(points[at], points[at + 1u], points[at + 2u]);
    var place = standardized(point - vec3<f32>(mean[0], mean[1], mean[2]));
    if (mapping.contracts != 0u) {
        let inverse = inverse_radius(place);
        place *= (2.0 - inverse) * inverse;
    }
    place = place * mapping.scale + mapping.offset;
    let to = mapping.width * i;
    coordinates[to] = place.x;
    coordinates[to + 1u] = place.y;
    coordinates[to + 2u] = place.z;
    if (mapping.width > 3u) {
        coordinates[to + 3u] = mapping.time;
    }
}
