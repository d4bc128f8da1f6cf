// A mean from the sums of blocks.
//
// The only workgroup reads `sums` and writes their sum, divided by `divisor`, to `mean[0]`.

// #include workgroup_sum

struct Parameters {
    blocks: u32,
    divisor: f32,
}

@group(0) @binding(0) var<storage, read_write> sums: array<f32>;
@group(0) @binding(1) var<storage, read_write> mean: array<f32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(local_invocation_index) lane: u32,
) {
    var sum = 0.0;
    for (var i = lane; i < parameters.blocks; i += WORKGROUP) {
        sum += sums[i];
    }
    let total = workgroup_sum(sum, lane);
    if (lane == 0u) {
        mean[0] = total / parameters.divisor;
    }
}
