// Derivative of the mean of absolute differences of two images (SQUARED: of squared ones) by the first.
//
// Each invocation computes one number. It reads `image`, `truth` and the gradient of its block's part of the mean, `upstream`, and
// writes `gradients`.

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> image: array<f32>;
@group(0) @binding(1) var<storage, read_write> truth: array<f32>;
@group(0) @binding(2) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(3) var<storage, read_write> gradients: array<f32>;
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
    let difference = image[i] - truth[i];
    let slope = select(sign(difference), 2.0 * difference, SQUARED == 1u);
    gradients[i] = upstream[i / BLOCK] / f32(parameters.count) * slope;
}
