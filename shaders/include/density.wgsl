// The network of a channel's density. `light4gs-model/src/ops/density_likelihood` has the formulas.
//
// Every layer has room for three numbers in and three out. Its weights are five vectors: the columns of its matrix, its bias, its
// factor. What a layer lacks is zero, so that nothing comes from it, and no gradient goes to it.

const VECTORS: u32 = 5u;
const BIAS: u32 = 3u;
const FACTOR: u32 = 4u;
// The place of what a layer lacks.
const NOWHERE: u32 = 0xffffffffu;

struct Densities {
    channels: u32,
    // Values of a channel.
    count: u32,
    // Groups of BLOCK values of a channel.
    blocks: u32,
    // Parameters of a channel.
    size: u32,
    // Half the width of the intervals.
    half_width: f32,
    // Of each layer: where its parameters begin in a channel's, numbers in, numbers out, whether it bends.
    layers: array<vec4<u32>, LAYERS>,
}

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> parameters: array<f32>;

// After softplus and tanh.
var<workgroup> weights: array<vec3<f32>, VECTORS * LAYERS>;

// The values of a workgroup: it owns a block of a channel.
struct Share {
    channel: u32,
    block: u32,
    first: u32,
    end: u32,
}

fn share_of(group: u32) -> Share {
    let channel = group / densities.blocks;
    let block = group % densities.blocks;
    let first = min(block * BLOCK, densities.count);
    let end = min(first + BLOCK, densities.count);
    return Share(channel, block, channel * densities.count + first, channel * densities.count + end);
}

// The place of a number of a layer's vector in a channel's parameters, which hold the matrix output by output.
fn place_of(layer: vec4<u32>, vector: u32, output: u32) -> u32 {
    let inputs = layer.y;
    let outputs = layer.z;
    let has = output < outputs && (vector >= BIAS || vector < inputs) && (vector != FACTOR || layer.w != 0u);
    let of_matrix = output * inputs + vector;
    let behind = (inputs + vector - BIAS) * outputs + output;
    return select(NOWHERE, layer.x + select(behind, of_matrix, vector < BIAS), has);
}

// The logistic function, and its derivative.
fn logistic(x: f32) -> vec2<f32> {
    let shrunk = exponential(-abs(x));
    let above = 1.0 / (1.0 + shrunk);
    let below = shrunk * above;
    return vec2<f32>(select(below, above, x >= 0.0), below * above);
}

// ln(1 + exp x). With y = exp(-|x|), ln(1 + y) is twice the inverse hyperbolic tangent of z = y / (2 + y), which is at most 1/3.
// Taylor's series, whose next term is below 1e-8.
fn softplus(x: f32) -> f32 {
    let y = exponential(-abs(x));
    let z = y / (2.0 + y);
    let square = z * z;
    var series = 1.0 / 11.0 + square * (1.0 / 13.0);
    series = 1.0 / 9.0 + square * series;
    series = 1.0 / 7.0 + square * series;
    series = 1.0 / 5.0 + square * series;
    series = 1.0 / 3.0 + square * series;
    series = 1.0 + square * series;
    return max(x, 0.0) + 2.0 * z * series;
}

// To 1e-7.
fn tangent(x: f32) -> f32 {
    let shrunk = exponential(-2.0 * abs(x));
    return sign(x) * (1.0 - shrunk) / (1.0 + shrunk);
}

fn tangents(x: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(tangent(x.x), tangent(x.y), tangent(x.z));
}

fn weight_of(parameter: f32, vector: u32) -> f32 {
    if (vector < BIAS) {
        return softplus(parameter);
    }
    if (vector == FACTOR) {
        return tangent(parameter);
    }
    return parameter;
}

// Fills `weights`; a barrier must follow.
fn read_weights(channel: u32, lane: u32) {
    for (var own = lane; own < VECTORS * LAYERS; own += WORKGROUP) {
        let vector = own % VECTORS;
        var numbers = vec3<f32>(0.0);
        for (var output = 0u; output < 3u; output++) {
            let place = place_of(densities.layers[own / VECTORS], vector, output);
            if (place != NOWHERE) {
                numbers[output] = weight_of(parameters[channel * densities.size + place], vector);
            }
        }
        weights[own] = numbers;
    }
}

// A layer's output before its nonlinearity.
fn mixed(layer: u32, numbers: vec3<f32>) -> vec3<f32> {
    let own = layer * VECTORS;
    let matrix = weights[own] * numbers.x + weights[own + 1u] * numbers.y + weights[own + 2u] * numbers.z;
    return matrix + weights[own + BIAS];
}
