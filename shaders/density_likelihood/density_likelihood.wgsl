// Probabilities of the intervals around the values of a channel under its density.
//
// A workgroup owns BLOCK values of a channel. Each of its invocations takes every WORKGROUP-th of them.

// #include exponential, density

@group(0) @binding(2) var<storage, read_write> likelihoods: array<f32>;
@group(0) @binding(3) var<uniform> densities: Densities;

fn logit_of(x: f32) -> f32 {
    var numbers = vec3<f32>(x, 0.0, 0.0);
    for (var layer = 0u; layer < LAYERS; layer++) {
        let sums = mixed(layer, numbers);
        numbers = sums + weights[layer * VECTORS + FACTOR] * tangents(sums);
    }
    return numbers.x;
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
    for (var i = share.first + lane; i < share.end; i += WORKGROUP) {
        let lower = logit_of(values[i] - densities.half_width);
        let upper = logit_of(values[i] + densities.half_width);
        // On the side where the logistic functions are small and so have full precision.
        let side = select(1.0, -1.0, lower + upper > 0.0);
        likelihoods[i] = abs(logistic(side * upper).x - logistic(side * lower).x);
    }
}
