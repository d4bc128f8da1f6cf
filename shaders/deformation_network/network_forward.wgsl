// The forward pass of a deformation network.
//
// A workgroup owns ROWS rows, which go through all layers in its memory; an invocation computes four channels of four rows at a
// time. Reads the features [N, F] and the parameters of all layers. Writes the outputs [N, O], and, if `first` is 1, those of the
// hidden layers after their ReLU, [N, H], for the backward pass.
//
// Of each layer, `places` has: where its input begins in the workgroup's memory, where its output does, its first column in the
// matrix that it is written to, and whether it is hidden.

// #include network

@group(0) @binding(0) var<storage, read_write> features: array<f32>;
@group(0) @binding(1) var<storage, read_write> parameters: array<f32>;
@group(0) @binding(2) var<storage, read_write> outputs: array<f32>;
@group(0) @binding(3) var<storage, read_write> hidden: array<f32>;
@group(0) @binding(4) var<uniform> network: Network;

// [channel][QUADS]
var<workgroup> block: array<vec4<f32>, 1024>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = flat_group(group, groups) * ROWS;
    let width = network.features;
    for (var own = lane; own < QUADS * width; own += WORKGROUP) {
        let channel = own % width;
        let quad = own / width;
        var values = vec4(0.0);
        for (var k = 0u; k < 4u; k++) {
            let row = first + 4u * quad + k;
            if (row < network.rows) {
                values[k] = features[row * width + channel];
            }
        }
        block[channel * QUADS + quad] = values;
    }
    for (var layer = 0u; layer < network.layers; layer++) {
        workgroupBarrier();
        let sizes = network.sizes[layer];
        let place = network.places[layer];
        let quads = QUADS * ((sizes.y + 3u) / 4u);
        for (var own = lane; own < quads; own += WORKGROUP) {
            let quad = own % QUADS;
            let channel = 4u * (own / QUADS);
            let columns = min(vec4(channel) + vec4(0u, 1u, 2u, 3u), vec4(sizes.y - 1u));
            var sums: array<vec4<f32>, 4>;
            for (var c = 0u; c < 4u; c++) {
                sums[c] = vec4(parameters[sizes.w + columns[c]]);
            }
            for (var k = 0u; k < sizes.x; k++) {
                let input = block[(place.x + k) * QUADS + quad];
                let weights = sizes.z + k * sizes.y;
                for (var c = 0u; c < 4u; c++) {
                    sums[c] += input * parameters[weights + columns[c]];
                }
            }
            for (var c = 0u; c < min(4u, sizes.y - channel); c++) {
                var sum = sums[c];
                if (place.w == 1u) {
                    sum = max(sum, vec4(0.0));
                    block[(place.y + channel + c) * QUADS + quad] = sum;
                }
                for (var k = 0u; k < 4u; k++) {
                    let row = first + 4u * quad + k;
                    if (row < network.rows) {
                        if (place.w == 1u) {
                            if (network.first == 0u) {
                                continue;
                            }
                            hidden[row * network.hidden + place.z + channel + c] = sum[k];
                        } else {
                            outputs[row * network.outputs + place.z + channel + c] = sum[k];
                        }
                    }
                }
            }
        }
    }
}
