// First of the parts of a deformation network's derivative: the gradients of all layers' outputs, before any ReLU, and of the
// features.
//
// A workgroup owns ROWS rows, which go through all layers backward in its memory; an invocation computes four channels of four
// rows at a time. Reads the parameters of all layers, the outputs of the hidden ones after their ReLU [N, H], and the gradient of
// the network's output [N, O]. Writes the gradients of all layers' outputs [N, H + O], those of hidden layers first, and those of
// the features [N, F].
//
// Of each layer, `places` has: where the gradient of its output begins in the workgroup's memory, where that of its input does,
// its first column in [N, H + O], and flags: 1 if it is hidden, 2 if another layer has already written to the gradient of its
// input. `first`: where the gradient of the features begins.

// #include network

@group(0) @binding(0) var<storage, read_write> parameters: array<f32>;
@group(0) @binding(1) var<storage, read_write> hidden: array<f32>;
@group(0) @binding(2) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(3) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(4) var<storage, read_write> of_features: array<f32>;
@group(0) @binding(5) var<uniform> network: Network;

// [channel][QUADS]
var<workgroup> block: array<vec4<f32>, 1024>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = flat_group(group, groups) * ROWS;
    let all = network.hidden + network.outputs;
    for (var later = 0u; later < network.layers; later++) {
        let layer = network.layers - 1u - later;
        let sizes = network.sizes[layer];
        let place = network.places[layer];
        let is_hidden = (place.w & 1u) != 0u;
        workgroupBarrier();
        for (var own = lane; own < QUADS * sizes.y; own += WORKGROUP) {
            let channel = own % sizes.y;
            let quad = own / sizes.y;
            let here = (place.x + channel) * QUADS + quad;
            var gradient = vec4(0.0);
            if (is_hidden) {
                gradient = block[here];
            }
            for (var k = 0u; k < 4u; k++) {
                let row = first + 4u * quad + k;
                if (row < network.rows) {
                    if (!is_hidden) {
                        gradient[k] = upstream[row * network.outputs + place.z - network.hidden + channel];
                    } else if (hidden[row * network.hidden + place.z + channel] <= 0.0) {
                        gradient[k] = 0.0;
                    }
                    gradients[row * all + place.z + channel] = gradient[k];
                }
            }
            block[here] = gradient;
        }
        workgroupBarrier();
        let quads = QUADS * ((sizes.x + 3u) / 4u);
        for (var own = lane; own < quads; own += WORKGROUP) {
            let quad = own % QUADS;
            let channel = 4u * (own / QUADS);
            let weights = sizes.z + min(vec4(channel) + vec4(0u, 1u, 2u, 3u), vec4(sizes.x - 1u)) * sizes.y;
            // By the standard it is all zeros in each round; in Chromium it is not.
            var sums: array<vec4<f32>, 4>;
            for (var k = 0u; k < 4u; k++) {
                sums[k] = vec4(0.0);
            }
            for (var c = 0u; c < sizes.y; c++) {
                let gradient = block[(place.x + c) * QUADS + quad];
                for (var k = 0u; k < 4u; k++) {
                    sums[k] += gradient * parameters[weights[k] + c];
                }
            }
            for (var k = 0u; k < min(4u, sizes.x - channel); k++) {
                let here = (place.y + channel + k) * QUADS + quad;
                var sum = sums[k];
                if ((place.w & 2u) != 0u) {
                    sum += block[here];
                }
                block[here] = sum;
            }
        }
    }
    workgroupBarrier();
    let width = network.features;
    for (var own = lane; own < QUADS * width; own += WORKGROUP) {
        let channel = own % width;
        let quad = own / width;
        let gradient = block[(network.first + channel) * QUADS + quad];
        for (var k = 0u; k < 4u; k++) {
            let row = first + 4u * quad + k;
            if (row < network.rows) {
                of_features[row * width + channel] = gradient[k];
            }
        }
    }
}
