// The regularizer of the planes of one scale: second differences along the height, and distance from 1.
//
// A workgroup owns BLOCK numbers of the planes, which lie one after another, each where its gradients begin. Reads the planes. Writes
// the sum of the workgroup's terms, and the gradients for a loss that counts once.

// #include workgroup_sum

struct Parameters {
    // Numbers of all planes, with the gaps between them.
    count: vec4<u32>,
    // Of each plane: its first number, the count of its numbers, height, width.
    shapes: array<vec4<u32>, 6>,
    // Of each plane: the weight of a squared second difference, and that of a distance.
    weights: array<vec4<f32>, 6>,
}

@group(0) @binding(0) var<storage, read_write> xy: array<f32>;
@group(0) @binding(1) var<storage, read_write> xz: array<f32>;
@group(0) @binding(2) var<storage, read_write> xt: array<f32>;
@group(0) @binding(3) var<storage, read_write> yz: array<f32>;
@group(0) @binding(4) var<storage, read_write> yt: array<f32>;
@group(0) @binding(5) var<storage, read_write> zt: array<f32>;
@group(0) @binding(6) var<storage, read_write> sums: array<f32>;
@group(0) @binding(7) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(8) var<uniform> parameters: Parameters;

fn value_at(plane: u32, i: u32) -> f32 {
    switch plane {
        case 0u: { return xy[i]; }
        case 1u: { return xz[i]; }
        case 2u: { return xt[i]; }
        case 3u: { return yz[i]; }
        case 4u: { return yt[i]; }
        default: { return zt[i]; }
    }
}

// The second difference around a row; 0 where it lacks a neighbor.
fn second_difference(plane: u32, i: u32, row: u32, shape: vec4<u32>) -> f32 {
    if (row == 0u || row + 1u >= shape.z) {
        return 0.0;
    }
    return value_at(plane, i - shape.w) - 2.0 * value_at(plane, i) + value_at(plane, i + shape.w);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = flat_group(group, groups);
    let end = min((block + 1u) * BLOCK, parameters.count.x);
    var sum = 0.0;
    for (var number = block * BLOCK + lane; number < end; number += WORKGROUP) {
        var plane = 0u;
        for (var next = 1u; next < 6u; next++) {
            plane += select(0u, 1u, number >= parameters.shapes[next].x);
        }
        let shape = parameters.shapes[plane];
        let i = number - shape.x;
        if (i < shape.y) {
            let weights = parameters.weights[plane].xy;
            let row = (i / shape.w) % shape.z;
            let own = second_difference(plane, i, row, shape);
            var around = -2.0 * own;
            if (row > 0u) {
                around += second_difference(plane, i - shape.w, row - 1u, shape);
            }
            if (row + 1u < shape.z) {
                around += second_difference(plane, i + shape.w, row + 1u, shape);
            }
            let off = value_at(plane, i) - 1.0;
            sum += weights.x * own * own + weights.y * abs(off);
            gradients[number] = 2.0 * weights.x * around + weights.y * sign(off);
        }
    }
    let total = workgroup_sum(sum, lane);
    if (lane == 0u && block * BLOCK < parameters.count.x) {
        sums[block] = total;
    }
}
