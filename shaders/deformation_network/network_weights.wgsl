// Second of the parts of a deformation network's derivative: the gradients of the parameters, summed over each part of the rows.
//
// A workgroup owns a tile of SIDE inputs and as many outputs of one layer, and one part of the rows; each of its WORKGROUP
// invocations owns four inputs by four outputs. A bias is the weight of an input that is always 1, the last one. Reads the
// features [N, F], the outputs of the hidden layers after their ReLU [N, H], and the gradients of all layers' outputs [N, H + O].
// Writes sums [parts][parameters].
//
// Of each layer, `places` has: the first column of its input in [N, H], or FEATURES; the first column of its output in
// [N, H + O]; the tiles of the layers up to this one; and its tiles along the outputs. `first`: rows of a part. `second`: numbers
// of all parameters.

// #include network

const SIDE: u32 = 32u;
const FEATURES: u32 = 0xffffffffu;
// Rows that are in the workgroup's memory at a time.
const STEP: u32 = 16u;

@group(0) @binding(0) var<storage, read_write> features: array<f32>;
@group(0) @binding(1) var<storage, read_write> hidden: array<f32>;
@group(0) @binding(2) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;
@group(0) @binding(4) var<uniform> network: Network;

// [STEP][SIDE / 4]
var<workgroup> inputs: array<vec4<f32>, 128>;
var<workgroup> outputs: array<vec4<f32>, 128>;

fn input_at(layer: u32, row: u32, k: u32, end: u32) -> f32 {
    let column = network.places[layer].x;
    if (row >= end || k > network.sizes[layer].x) {
        return 0.0;
    }
    if (k == network.sizes[layer].x) {
        return 1.0;
    }
    if (column == FEATURES) {
        return features[row * network.features + k];
    }
    return hidden[row * network.hidden + column + k];
}

fn gradient_at(layer: u32, row: u32, c: u32, end: u32) -> f32 {
    if (row >= end || c >= network.sizes[layer].y) {
        return 0.0;
    }
    return gradients[row * (network.hidden + network.outputs) + network.places[layer].y + c];
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let tiles = network.places[network.layers - 1u].z;
    let own = flat_group(group, groups);
    let part = own / tiles;
    let number = own % tiles;
    var layer = 0u;
    var before = 0u;
    for (var next = 0u; next + 1u < network.layers; next++) {
        if (number >= network.places[next].z) {
            layer = next + 1u;
            before = network.places[next].z;
        }
    }
    let sizes = network.sizes[layer];
    let along = network.places[layer].w;
    let first_input = SIDE * ((number - before) / along);
    let first_output = SIDE * ((number - before) % along);
    let begin = min(part * network.first, network.rows);
    let end = min(begin + network.first, network.rows);

    let k = lane / 8u;
    let c = lane % 8u;
    var totals: array<vec4<f32>, 4>;
    for (var row = begin; row < end; row += STEP) {
        workgroupBarrier();
        for (var place = lane; place < 8u * STEP; place += WORKGROUP) {
            let here = row + place / 8u;
            let at = 4u * (place % 8u);
            var values = vec4(0.0);
            var slopes = vec4(0.0);
            for (var j = 0u; j < 4u; j++) {
                values[j] = input_at(layer, here, first_input + at + j, end);
                slopes[j] = gradient_at(layer, here, first_output + at + j, end);
            }
            inputs[place] = values;
            outputs[place] = slopes;
        }
        workgroupBarrier();
        for (var step = 0u; step < STEP; step++) {
            let input = inputs[8u * step + k];
            let output = outputs[8u * step + c];
            for (var j = 0u; j < 4u; j++) {
                totals[j] += input[j] * output;
            }
        }
    }
    for (var j = 0u; j < 4u; j++) {
        let input = first_input + 4u * k + j;
        for (var i = 0u; i < 4u; i++) {
            let output = first_output + 4u * c + i;
            if (begin < network.rows && input <= sizes.x && output < sizes.y) {
                let place = select(sizes.z + input * sizes.y + output, sizes.w + output, input == sizes.x);
                sums[part * network.second + place] = totals[j][i];
            }
        }
    }
}
