// A mean from the sums of blocks.
//
// The only workgroup reads `sums` and writes their sum, divided by `divisor`, to `mean[0]`.

struct Parameters {
    blocks: u32,
    divisor: f32,
}

@group(0) @binding(0) var<storage, read_write> sums: array<f32>;
@group(0) @binding(1) var<storage, read_write> mean: array<f32>;
@group(0) @binding(2) var<uniform> parameters: Parameters;

var<workgroup> totals: array<f32, WORKGROUP>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(local_invocation_index) lane: u32,
) {
    var sum = 0.0;
    for (var i = lane; i < parameters.blocks; i += WORKGROUP) {
        sum += sums[i];
    }
    totals[lane] = sum;
    workgroupBarrier();
    for (var step = WORKGROUP / 2u; step > 0u; step = step / 2u) {
        if (lane < step) {
            totals[lane] += totals[lane + step];
        }
        workgroupBarrier();
    }
    if (lane == 0u) {
        mean[0] = totals[0] / parameters.divisor;
    }
}
