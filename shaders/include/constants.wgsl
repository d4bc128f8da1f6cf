// Thresholds and units: those of `light4gs-model/src/cpu`, docs/design.md.

const NEAR: f32 = 0.2;
const DILATION: f32 = 0.3;
const TILE: u32 = 16u;
const MIN_ALPHA: f32 = 1.0 / 255.0;
const MAX_ALPHA: f32 = 0.99;
const MIN_TRANSMITTANCE: f32 = 1e-4;
const INVALID_RADIUS: i32 = -1;

// By bits: WGSL lets a compiler assume that there are neither infinities nor NaN.
fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

fn is_finite3(v: vec3<f32>) -> bool {
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

// Like the CPU's, term by term: an order of additions that the builtin leaves open decides the order of depths.
fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
