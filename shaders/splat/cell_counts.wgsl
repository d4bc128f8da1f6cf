// Sorts the Gaussians' numbers of cells by depth.
//
// Each invocation computes one position in that order. It reads the Gaussian at the position and its splat, and writes
// the splat's number of cells. A prefix sum of these numbers then gives the position of its first intersection.

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
