// The mean of the absolute differences of two images (SQUARED: of the squared ones), in parts that are to be added up.
//
// A workgroup owns a block of BLOCK numbers of `image` and `truth`, and writes its part to `parts`.

// #include workgroup_sum

struct Parameters {
    count: u32,
}

@group(0) @binding(0) var<storage, read_write> image: array<f32>;
@group(0) @binding(1) var<storage, read_write> truth: array<f32>;
@group(0) @binding(2) var<storage, read_write> parts: array<f32>;
@group(0) @binding(3) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = flat_group(group, groups);
    let end = min((block + 1u) * BLOCK, parameters.count);
    var sum = 0.0;
    for (var i = block * BLOCK + lane; i < end; i += WORKGROUP) {
        let difference = image[i] - truth[i];
        sum += select(abs(difference), difference * difference, SQUARED == 1u);
    }
    let total = workgroup_sum(sum, lane);
    if (lane == 0u && block * BLOCK < parameters.count) {
        parts[block] = total / f32(parameters.count);
    }
}
