// Derivative of the probabilities of the intervals around the values of a channel under its density.
//
// A workgroup owns BLOCK values of a channel. Each of its invocations takes every WORKGROUP-th of them, writes its gradient, and sums
// the gradients of the weights; then each sum is added up over the invocations, by halves. Writes for each block the gradients of the
// parameters of all channels `[blocks, C, P]`.

// #include arithmetic, exponential, density

@group(0) @binding(2) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(3) var<storage, read_write> of_values: array<f32>;
@group(0) @binding(4) var<storage, read_write> of_parameters: array<f32>;
@group(0) @binding(5) var<uniform> densities: Densities;

alias OfWeights = array<vec3<f32>, VECTORS * LAYERS>;

// A layer's sums of each invocation.
var<workgroup> partial: array<array<vec3<f32>, VECTORS>, WORKGROUP>;

// An edge of an interval on its way through the network.
struct Edge {
    // What each layer gets.
    inputs: array<vec3<f32>, LAYERS>,
    // The hyperbolic tangents of what it makes of that.
    bent: array<vec3<f32>, LAYERS>,
    logit: f32,
}

fn edge_of(x: f32) -> Edge {
    var edge: Edge;
    var numbers = vec3<f32>(x, 0.0, 0.0);
    for (var layer = 0u; layer < LAYERS; layer++) {
        edge.inputs[layer] = numbers;
        let sums = mixed(layer, numbers);
        let bent = tangents(sums);
        edge.bent[layer] = bent;
        numbers = sums + weights[layer * VECTORS + FACTOR] * bent;
    }
    edge.logit = numbers.x;
    return edge;
}

// Adds an edge's gradients of the weights to `sums`, and returns that of its place.
fn descend(edge: ptr<function, Edge>, of_logit: f32, sums: ptr<function, OfWeights>) -> f32 {
    var of_outputs = vec3<f32>(of_logit, 0.0, 0.0);
    for (var k = 0u; k < LAYERS; k++) {
        let layer = LAYERS - 1u - k;
        let own = layer * VECTORS;
        let inputs = (*edge).inputs[layer];
        let bent = (*edge).bent[layer];
        let of_sums = of_outputs * (1.0 + weights[own + FACTOR] * (1.0 - bent * bent));
        (*sums)[own] += of_sums * inputs.x;
        (*sums)[own + 1u] += of_sums * inputs.y;
        (*sums)[own + 2u] += of_sums * inputs.z;
        (*sums)[own + BIAS] += of_sums;
        (*sums)[own + FACTOR] += of_outputs * bent;
        of_outputs = vec3<f32>(
            dot3(weights[own], of_sums),
            dot3(weights[own + 1u], of_sums),
            dot3(weights[own + 2u], of_sums),
        );
    }
    return of_outputs.x;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups);
    if (own >= densities.channels * densities.blocks) {
        return;
    }
    let share = share_of(own);
    read_weights(share.channel, lane);
    workgroupBarrier();
    var sums: OfWeights;
    for (var i = share.first + lane; i < share.end; i += WORKGROUP) {
        var lower = edge_of(values[i] - densities.half_width);
        var upper = edge_of(values[i] + densities.half_width);
        let side = select(1.0, -1.0, lower.logit + upper.logit > 0.0);
        let of_side = array(logistic(side * lower.logit), logistic(side * upper.logit));
        // Zero where the logistic functions are equal, and no step makes a difference.
        let toward = side * sign(of_side[1].x - of_side[0].x) * upstream[i];
        let of_lower = descend(&lower, -toward * of_side[0].y, &sums);
        let of_upper = descend(&upper, toward * of_side[1].y, &sums);
        of_values[i] = of_lower + of_upper;
    }
    for (var layer = 0u; layer < LAYERS; layer++) {
        for (var vector = 0u; vector < VECTORS; vector++) {
            partial[lane][vector] = sums[layer * VECTORS + vector];
        }
        workgroupBarrier();
        for (var step = WORKGROUP / 2u; step > 0u; step = step / 2u) {
            if (lane < step) {
                for (var vector = 0u; vector < VECTORS; vector++) {
                    partial[lane][vector] += partial[lane + step][vector];
                }
            }
            workgroupBarrier();
        }
        if (lane < VECTORS) {
            let of_weights = partial[0][lane];
            let row = share.channel * densities.size;
            for (var output = 0u; output < 3u; output++) {
                let place = place_of(densities.layers[layer], lane, output);
                if (place != NOWHERE) {
                    var slope = 1.0;
                    if (lane < BIAS) {
                        slope = logistic(parameters[row + place]).x;
                    }
                    if (lane == FACTOR) {
                        let bend = weights[layer * VECTORS + FACTOR][output];
                        slope = 1.0 - bend * bend;
                    }
                    of_parameters[share.block * densities.channels * densities.size + row + place] =
                        of_weights[output] * slope;
                }
            }
        }
        workgroupBarrier();
    }
}
