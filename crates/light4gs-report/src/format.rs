//! Numbers as people read them.

/// A count in groups of three digits: `12 345`.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut grouped = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    grouped
}

/// A number with the given number of decimals; a dash where there is no number.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    if value.is_nan() {
        "\u{2013}".to_owned()
    } else if value.is_infinite() {
        if value > 0.0 { "\u{221e}" } else { "\u{2212}\u{221e}" }.to_owned()
    } else {
        format!("{value:.decimals$}")
    }
}

/// A number on an axis or in a heading, in its shortest form.
pub(super) fn short(value: f64) -> String {
    let size = value.abs();
    let trimmed = |text: String| match text.split_once('.') {
        Some(_) => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        None => text,
    };
    if value == 0.0 {
        "0".to_owned()
    } else if !value.is_finite() {
        fixed(value, 0)
    } else if size >= 1e6 {
        format!("{}M", trimmed(format!("{:.2}", value / 1e6)))
    } else if size >= 1e4 {
        format!("{}k", trimmed(format!("{:.1}", value / 1e3)))
    } else if size >= 100.0 {
        trimmed(format!("{value:.1}"))
    } else if size >= 1.0 {
        trimmed(format!("{value:.2}"))
    } else if size >= 1e-3 {
        trimmed(format!("{value:.4}"))
    } else {
        format!("{value:.0e}")
    }
}
