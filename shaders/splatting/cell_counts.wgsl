// Puts the Gaussians' numbers of cells into the order of depths.
//
// One invocation owns one place in that order. Reads the Gaussian at the place and its splat; writes its count, of which
// a prefix sum then makes the place of its first intersection.

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> by_depth: array<u32>;
@group(0) @binding(1) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = flat_group(group, groups) * WORKGROUP + lane;
    if (place >= parameters.count) {
        return;
    }
    counts[place] = u32(splats[4u * by_depth[place] + 3u].w);
}
