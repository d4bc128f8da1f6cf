// Adds up every Gaussian's sums over its cells.
//
// Each invocation computes one Gaussian. It reads its splat and the sums of its intersections, which begin at three
// times `first_of_gaussian`, and adds them in their order. It writes `scores` [N, 3]: pixels, sum of T · alpha, sum of
// T · opacity.

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> first_of_gaussian: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<f32>;
@group(0) @binding(3) var<storage, read_write> scores: array<f32>;
@group(0) @binding(4) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= parameters.count) {
        return;
    }
    let cells = u32(splats[4u * i + 3u].w);
    var sum = vec3<f32>(0.0);
    var at = 3u * first_of_gaussian[i];
    for (var k = 0u; k < cells; k++) {
        sum += vec3<f32>(sums[at], sums[at + 1u], sums[at + 2u]);
        at += 3u;
    }
    let opacity = select(0.0, splats[4u * i].w, cells > 0u);
    scores[3u * i] = sum.x;
    scores[3u * i + 1u] = sum.y;
    scores[3u * i + 2u] = opacity * sum.z;
}
