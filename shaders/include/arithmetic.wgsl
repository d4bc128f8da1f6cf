// Finite numbers, and sums of products term by term.

// Tested by bits: WGSL lets a compiler assume that there are neither infinities nor NaN.
fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

fn is_finite3(v: vec3<f32>) -> bool {
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

// Term by term, like the CPU's: the builtin leaves the order of additions open, and rounding can decide the order of
// depths.
fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
