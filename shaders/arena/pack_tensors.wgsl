// Several tensors in one buffer, each where its place begins; or sums of tensors of one length.
//
// One invocation owns one number of a place. Tensors that do not exist, and those that are added to an earlier one, have the length 0.

struct Tensors {
    // Numbers of the longest one.
    longest: u32,
    // Of each tensor: its length, where it begins, and the number of tensors from it on that are added up there.
    places: array<vec4<u32>, 7>,
}

@group(0) @binding(0) var<storage, read_write> a: array<f32>;
@group(0) @binding(1) var<storage, read_write> b: array<f32>;
@group(0) @binding(2) var<storage, read_write> c: array<f32>;
@group(0) @binding(3) var<storage, read_write> d: array<f32>;
@group(0) @binding(4) var<storage, read_write> e: array<f32>;
@group(0) @binding(5) var<storage, read_write> f: array<f32>;
@group(0) @binding(6) var<storage, read_write> g: array<f32>;
@group(0) @binding(7) var<storage, read_write> packed: array<f32>;
@group(0) @binding(8) var<uniform> tensors: Tensors;

fn value_at(tensor: u32, i: u32) -> f32 {
    switch tensor {
        case 0u: { return a[i]; }
        case 1u: { return b[i]; }
        case 2u: { return c[i]; }
        case 3u: { return d[i]; }
        case 4u: { return e[i]; }
        case 5u: { return f[i]; }
        default: { return g[i]; }
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    if (own >= 7u * tensors.longest) {
        return;
    }
    let tensor = own / tensors.longest;
    let i = own % tensors.longest;
    let place = tensors.places[tensor];
    if (i < place.x) {
        var sum = value_at(tensor, i);
        for (var part = 1u; part < place.z; part++) {
            sum += value_at(tensor + part, i);
        }
        packed[place.y + i] = sum;
    }
}
