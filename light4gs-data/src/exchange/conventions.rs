//! Quaternions and colors as other formats have them.

/// `(w, x, y, z)` of any length to `(x, y, z, w)` of length 1; the identity for one that has no direction.
pub(super) fn unit_xyzw([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    let length = (w * w + x * x + y * y + z * z).sqrt();
    if length > 0.0 && length.is_finite() { [x, y, z, w].map(|part| part / length) } else { [0.0, 0.0, 0.0, 1.0] }
}

/// IEC 61966-2-1.
pub(super) fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}
