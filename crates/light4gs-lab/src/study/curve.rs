//! Curves of quality over cost, such as rate-distortion curves: the convex hull of measured points, and Bjøntegaard's
//! difference between two curves.
//!
//! Sources: G. Bjøntegaard, *Calculation of average PSNR differences between RD-curves*, VCEG-M33, 2001. Between the
//! points, the curve is the piecewise cubic Hermite interpolation (Fritsch and Carlson 1980) of the JCT-VC's sheets,
//! which cannot overshoot, instead of one cubic polynomial through all points.

use serde::{Deserialize, Serialize};

/// A measured run: what it costs, and its quality.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Bytes of the file or minutes of training, above 0.
    pub cost: f64,
    /// Quality in dB; more is better.
    pub psnr: f64,
}

/// The difference between two curves, over the range that both cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BjontegaardDelta {
    /// Mean difference in cost at equal quality, percent; negative is cheaper: of bytes, the BD-rate. `None` if the
    /// curves share no range of quality.
    pub cost_percent: Option<f64>,
    /// Mean difference in quality at equal cost, dB; positive is better. `None` if the curves share no range of cost.
    pub psnr: Option<f64>,
}

/// The points that no mixture of two others surpasses, by ascending cost: the upper left of the convex hull, over the
/// logarithm of the cost. Along it, costs and qualities are strictly ascending. Points that are not finite, or without
/// cost, are left out.
pub fn convex_hull(points: &[CurvePoint]) -> Vec<CurvePoint> {
    let mut sorted: Vec<CurvePoint> =
        points.iter().copied().filter(|p| p.cost > 0.0 && p.cost.is_finite() && p.psnr.is_finite()).collect();
    // Of points with equal cost, the best comes first.
    sorted.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(b.psnr.total_cmp(&a.psnr)));
    let mut hull: Vec<CurvePoint> = Vec::new();
    for point in sorted {
        if hull.last().is_some_and(|last| point.psnr <= last.psnr) {
            continue;
        }
        while let [.., before, last] = hull[..]
            && slope(before, last) <= slope(last, point)
        {
            hull.pop();
        }
        hull.push(point);
    }
    hull
}

/// dB for each factor e in cost.
fn slope(a: CurvePoint, b: CurvePoint) -> f64 {
    (b.psnr - a.psnr) / (b.cost.ln() - a.cost.ln())
}

/// The difference of `curve` from `anchor`. Each needs at least two points, with costs and qualities that ascend
/// together, as on a [`convex_hull`]; `None` if one has fewer.
pub fn bjontegaard(anchor: &[CurvePoint], curve: &[CurvePoint]) -> Option<BjontegaardDelta> {
    let [anchor, curve] = [anchor, curve].map(rising);
    let (anchor, curve) = (anchor?, curve?);
    let by_quality = |points: &[CurvePoint]| Hermite::new(points.iter().map(|p| (p.psnr, p.cost.ln())).collect());
    let by_cost = |points: &[CurvePoint]| Hermite::new(points.iter().map(|p| (p.cost.ln(), p.psnr)).collect());
    let log_rate = mean_difference(&by_quality(&anchor), &by_quality(&curve));
    Some(BjontegaardDelta {
        cost_percent: log_rate.map(|difference| 100.0 * difference.exp_m1()),
        psnr: mean_difference(&by_cost(&anchor), &by_cost(&curve)),
    })
}

/// The points by ascending cost; `None` if there are fewer than two, or if quality does not ascend with cost.
fn rising(points: &[CurvePoint]) -> Option<Vec<CurvePoint>> {
    let mut points = points.to_vec();
    points.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let rises = points.iter().all(|p| p.cost > 0.0 && p.cost.is_finite() && p.psnr.is_finite())
        && points.windows(2).all(|pair| pair[0].cost < pair[1].cost && pair[0].psnr < pair[1].psnr);
    (points.len() >= 2 && rises).then_some(points)
}

/// Mean of `curve - anchor` over the range of x that both cover.
fn mean_difference(anchor: &Hermite, curve: &Hermite) -> Option<f64> {
    let (low, high) = (anchor.first().max(curve.first()), anchor.last().min(curve.last()));
    (low < high).then(|| (curve.integral(low, high) - anchor.integral(low, high)) / (high - low))
}

/// A monotone piecewise cubic through points of ascending x.
struct Hermite {
    points: Vec<(f64, f64)>,
    /// Derivative at each point.
    slopes: Vec<f64>,
}

impl Hermite {
    fn new(points: Vec<(f64, f64)>) -> Self {
        let widths: Vec<f64> = points.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        let secants: Vec<f64> =
            points.windows(2).zip(&widths).map(|(pair, width)| (pair[1].1 - pair[0].1) / width).collect();
        let last = secants.len() - 1;
        let slopes = (0..points.len())
            .map(|i| match i {
                _ if last == 0 => secants[0],
                0 => end_slope(widths[0], widths[1], secants[0], secants[1]),
                _ if i > last => end_slope(widths[last], widths[last - 1], secants[last], secants[last - 1]),
                _ => inner_slope(widths[i - 1], widths[i], secants[i - 1], secants[i]),
            })
            .collect();
        Self { points, slopes }
    }

    fn first(&self) -> f64 {
        self.points[0].0
    }

    fn last(&self) -> f64 {
        self.points[self.points.len() - 1].0
    }

    /// The integral between two x inside of the range.
    fn integral(&self, low: f64, high: f64) -> f64 {
        let pieces = self.points.windows(2).zip(self.slopes.windows(2));
        pieces
            .map(|(ends, slopes)| {
                let [(x0, y0), (x1, y1)] = [ends[0], ends[1]];
                let (from, to) = (low.max(x0), high.min(x1));
                if from >= to {
                    return 0.0;
                }
                // y0 + d0 s + b s² + c s³ with s = x - x0.
                let width = x1 - x0;
                let secant = (y1 - y0) / width;
                let b = (3.0 * secant - 2.0 * slopes[0] - slopes[1]) / width;
                let c = (slopes[0] + slopes[1] - 2.0 * secant) / (width * width);
                let primitive = |s: f64| s * (y0 + s * (slopes[0] / 2.0 + s * (b / 3.0 + s * c / 4.0)));
                primitive(to - x0) - primitive(from - x0)
            })
            .sum()
    }
}

/// Weighted harmonic mean of the secants on both sides; 0 at a turning point.
fn inner_slope(width_before: f64, width_after: f64, before: f64, after: f64) -> f64 {
    if before * after <= 0.0 {
        return 0.0;
    }
    let (w1, w2) = (2.0 * width_after + width_before, width_after + 2.0 * width_before);
    (w1 + w2) / (w1 / before + w2 / after)
}

/// Three-point formula at an end, kept monotone. `near` is the secant at the end, `far` the next one.
fn end_slope(near_width: f64, far_width: f64, near: f64, far: f64) -> f64 {
    let slope = ((2.0 * near_width + far_width) * near - near_width * far) / (near_width + far_width);
    if slope * near <= 0.0 {
        0.0
    } else if near * far <= 0.0 && slope.abs() > 3.0 * near.abs() {
        3.0 * near
    } else {
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(rows: &[(f64, f64)]) -> Vec<CurvePoint> {
        rows.iter().map(|&(cost, psnr)| CurvePoint { cost, psnr }).collect()
    }

    /// The example that comes with most implementations of VCEG-M33. The values are those of the Python package
    /// `bjontegaard` 1.3 (its method `pchip` agrees with the JCT-VC's sheet, as its authors report).
    #[test]
    fn the_published_example() {
        let anchor = points(&[(686.76, 40.28), (309.58, 37.18), (157.11, 34.24), (85.95, 31.42)]);
        let curve = points(&[(893.34, 40.39), (407.8, 37.21), (204.93, 34.17), (112.75, 31.24)]);
        let delta = bjontegaard(&anchor, &curve).unwrap();
        assert!((delta.cost_percent.unwrap() - 31.379_878_202_397_627).abs() < 1e-6, "{delta:?}");
        assert!((delta.psnr.unwrap() + 1.183_472_404_622_459_2).abs() < 1e-6, "{delta:?}");
    }

    #[test]
    fn half_the_bytes_at_equal_quality() {
        let anchor = points(&[(100.0, 20.0), (200.0, 25.0), (400.0, 28.0), (900.0, 30.0), (1000.0, 30.1)]);
        let half: Vec<_> = anchor.iter().map(|p| CurvePoint { cost: p.cost / 2.0, ..*p }).collect();
        let delta = bjontegaard(&anchor, &half).unwrap();
        assert!((delta.cost_percent.unwrap() + 50.0).abs() < 1e-9);
        let back = bjontegaard(&half, &anchor).unwrap();
        assert!((back.cost_percent.unwrap() - 100.0).abs() < 1e-9);
        let same = bjontegaard(&anchor, &anchor).unwrap();
        assert_eq!((same.cost_percent, same.psnr), (Some(0.0), Some(0.0)));
    }

    #[test]
    fn curves_that_do_not_overlap_have_no_difference() {
        let low = points(&[(100.0, 20.0), (200.0, 21.0)]);
        let high = points(&[(100.0, 25.0), (200.0, 26.0)]);
        let delta = bjontegaard(&low, &high).unwrap();
        assert_eq!(delta.cost_percent, None);
        assert!((delta.psnr.unwrap() - 5.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_curve() {
        let line = points(&[(100.0, 20.0), (200.0, 21.0)]);
        for bad in [
            points(&[]),
            points(&[(100.0, 20.0)]),
            points(&[(100.0, 20.0), (100.0, 21.0)]),
            points(&[(100.0, 20.0), (200.0, 19.0)]),
            points(&[(0.0, 20.0), (200.0, 21.0)]),
            points(&[(100.0, f64::NAN), (200.0, 21.0)]),
        ] {
            assert_eq!(bjontegaard(&line, &bad), None, "{bad:?}");
            assert_eq!(bjontegaard(&bad, &line), None, "{bad:?}");
        }
    }

    #[test]
    fn hulls_of_degenerate_points() {
        assert!(convex_hull(&[]).is_empty());
        assert!(convex_hull(&points(&[(f64::NAN, 1.0), (0.0, 1.0), (-1.0, 1.0), (1.0, f64::INFINITY)])).is_empty());
        let one = points(&[(5.0, 20.0)]);
        assert_eq!(convex_hull(&one), one);
        assert_eq!(convex_hull(&points(&[(5.0, 20.0), (5.0, 20.0), (5.0, 19.0)])), one);
        // A point of higher cost and no better quality is not on the hull.
        assert_eq!(convex_hull(&points(&[(5.0, 20.0), (6.0, 20.0), (9.0, 3.0)])), one);
        // Of points on a line, only the ends are needed.
        let e = std::f64::consts::E;
        let line = points(&[(1.0, 1.0), (e, 2.0), (e * e, 3.0)]);
        assert_eq!(convex_hull(&line), [line[0], line[2]]);
    }

    #[test]
    fn a_hull_is_above_every_point() {
        // A fixed sequence of irregular numbers.
        let mut state = 12345u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        for _ in 0..200 {
            let all: Vec<_> =
                (0..12).map(|_| CurvePoint { cost: 1.0 + 9.0 * random(), psnr: 20.0 + 10.0 * random() }).collect();
            let hull = convex_hull(&all);
            assert!(hull.windows(2).all(|pair| pair[0].cost < pair[1].cost && pair[0].psnr < pair[1].psnr));
            for pair in hull.windows(2) {
                for p in all.iter().filter(|p| p.cost >= pair[0].cost && p.cost <= pair[1].cost) {
                    let on_it = pair[0].psnr + slope(pair[0], pair[1]) * (p.cost.ln() - pair[0].cost.ln());
                    assert!(p.psnr <= on_it + 1e-9);
                }
            }
        }
    }
}
