// Sums of tensors side by side in one buffer, each where its place begins. A sum of one tensor is a copy.
//
// One invocation owns one number of the buffer, from `first` on. The tensors lie in up to seven buffers, several in one.

// #include tensors

struct Tensors {
    // Sums.
    count: u32,
    // Where the first one begins, and numbers from there on, with the gaps between them.
    first: u32,
    total: u32,
    unused: u32,
    // Of each sum: where it begins, its length, its first part, its number of parts.
    places: array<vec4<u32>, MOST_SUMS>,
    // Of each part: its buffer, and where it begins there.
    parts: array<vec4<u32>, MOST_PARTS>,
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

fn value_at(part: u32, i: u32) -> f32 {
    let place = tensors.parts[part];
    let at = place.y + i;
    switch place.x {
        case 0u: { return a[at]; }
        case 1u: { return b[at]; }
        case 2u: { return c[at]; }
        case 3u: { return d[at]; }
        case 4u: { return e[at]; }
        case 5u: { return f[at]; }
        default: { return g[at]; }
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = flat_group(group, groups) * WORKGROUP + lane;
    if (own >= tensors.total) {
        return;
    }
    let at = tensors.first + own;
    let place = tensors.places[tensor_at(at)];
    let i = at - place.x;
    if (i < place.y) {
        var sum = value_at(place.z, i);
        for (var part = 1u; part < place.w; part++) {
            sum += value_at(place.z + part, i);
        }
        packed[at] = sum;
    }
}
