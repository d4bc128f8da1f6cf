// The exponential of numbers up to 0, to about one unit in the last place. WGSL allows its own to be wrong by 3 + 2 |x|
// units. At the exponents of a distribution's tail, that is most of the digits that `normal.wgsl` must keep.

// 2^n for n from -126 to 127.
fn power_of_two(n: i32) -> f32 {
    return bitcast<f32>(u32(n + 127) << 23u);
}

fn exponential(x: f32) -> f32 {
    // Below the smallest float32.
    if (x < -104.0) {
        return 0.0;
    }
    // x = n ln 2 + r, |r| <= ln 2 / 2. The logarithm is in two parts; the product of n with the first is exact.
    let n = round(x * 1.44269504);
    let r = (x - n * 0.693359375) + n * 2.12194440e-4;
    // Taylor's series, whose next term is below 6e-9.
    var series = 1.0 / 720.0 + r * (1.0 / 5040.0);
    series = 1.0 / 120.0 + r * series;
    series = 1.0 / 24.0 + r * series;
    series = 1.0 / 6.0 + r * series;
    series = 0.5 + r * series;
    series = 1.0 + r * series;
    series = 1.0 + r * series;
    // In two steps, since 2^n alone may be too small to be a normal number.
    let half = i32(n) / 2;
    return series * power_of_two(half) * power_of_two(i32(n) - half);
}
