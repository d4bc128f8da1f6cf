//! Colors of the error maps.

/// Seventeen samples of "inferno", by Stéfan van der Walt and Nathaniel Smith for matplotlib (CC0): equal steps look
/// equal, brighter is always more, and the map stays readable with color blindness and on gray paper.
const INFERNO: [[u8; 3]; 17] = [
    [0, 0, 4],
    [11, 7, 36],
    [33, 12, 74],
    [61, 9, 101],
    [87, 16, 110],
    [113, 25, 110],
    [138, 34, 106],
    [163, 44, 97],
    [188, 55, 84],
    [210, 70, 68],
    [228, 90, 49],
    [241, 115, 29],
    [249, 142, 9],
    [252, 172, 17],
    [249, 203, 53],
    [242, 234, 105],
    [252, 255, 164],
];

/// The color of a value, 0 to 1. Values outside have the color of the nearer end.
pub fn inferno(value: f32) -> [u8; 3] {
    let last = INFERNO.len() - 1;
    // In this form NaN becomes 0.
    let value = if value > 0.0 { value.min(1.0) } else { 0.0 };
    let place = value * last as f32;
    let index = (place as usize).min(last - 1);
    let share = place - index as f32;
    let (from, to) = (INFERNO[index], INFERNO[index + 1]);
    std::array::from_fn(|channel| {
        let (from, to) = (f32::from(from[channel]), f32::from(to[channel]));
        (from + (to - from) * share).round() as u8
    })
}

/// The map as a CSS gradient.
pub(super) fn css_gradient() -> String {
    let stops: Vec<String> = INFERNO.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
    format!("linear-gradient(90deg,{})", stops.join(","))
}
