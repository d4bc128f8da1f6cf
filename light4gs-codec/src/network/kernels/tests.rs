//! Every operation against its definition in float64.

use super::*;
use crate::network::{Layer, LayerKind};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    fn numbers(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.next()).collect()
    }

    fn layer(&mut self, kind: LayerKind, inputs: u32, outputs: u32, kernel: u32, groups: u32) -> Layer {
        let mut layer = Layer { kind, inputs, outputs, kernel, groups, weight: Vec::new(), bias: Vec::new() };
        layer.weight = self.numbers(layer.weights() as usize);
        layer.bias = self.numbers(outputs as usize);
        layer
    }
}

/// A map as plain numbers.
struct Plain {
    size: [usize; 2],
    values: Vec<f32>,
}

impl Plain {
    fn random(random: &mut Random, channels: usize, size: [usize; 2]) -> Self {
        Self { size, values: random.numbers(channels * size[0] * size[1]) }
    }

    fn at(&self, channel: usize, y: isize, x: isize) -> f64 {
        let [height, width] = self.size;
        let inside = (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
        if inside { f64::from(self.values[(channel * height + y as usize) * width + x as usize]) } else { 0.0 }
    }

    fn padded(&self, border: usize) -> PaddedMap {
        PaddedMap::centered(&self.values, self.size, 0.0, border)
    }
}

/// The definition of a convolution of stride 1.
fn convolved(layer: &Layer, map: &Plain, output: usize, y: usize, x: usize) -> f64 {
    let Layer { inputs, outputs, kernel, groups, .. } = *layer;
    let [inputs, outputs, kernel, groups] = [inputs, outputs, kernel, groups].map(|size| size as usize);
    let (inputs, group) = (inputs / groups, output / (outputs / groups));
    let mut sum = f64::from(layer.bias[output]);
    for input in 0..inputs {
        for ky in 0..kernel {
            for kx in 0..kernel {
                let weight = layer.weight[((output * inputs + input) * kernel + ky) * kernel + kx];
                let shift = |at: usize, k: usize| (at + k) as isize - (kernel / 2) as isize;
                sum += f64::from(weight) * map.at(group * inputs + input, shift(y, ky), shift(x, kx));
            }
        }
    }
    sum
}

fn near(found: f32, expected: f64) {
    assert!((f64::from(found) - expected).abs() < 1e-4, "{found}, expected {expected}");
}

#[test]
fn convolutions() {
    let mut random = Random(1);
    let shapes = [
        (3, 5, 3, 1),
        (4, 8, 5, 4),
        (4, 6, 1, 2),
        (6, 9, 3, 3),
        (2, 4, 7, 1),
        (3, 19, 3, 1),
        (2, 13, 1, 1),
        (2, 24, 1, 1),
    ];
    for (inputs, outputs, kernel, groups) in shapes {
        let layer = random.layer(LayerKind::Convolution, inputs, outputs, kernel, groups);
        let map = Plain::random(&mut random, inputs as usize, [5, 11]);
        let convolution = Convolution::new(&layer);
        let padded = map.padded(kernel as usize / 2);
        let mut sums = vec![[0.0; LANES]; outputs as usize];
        for y in 0..5 {
            for columns in [Columns { first: 0, step: 1 }, Columns { first: 3, step: 1 }, Columns { first: 1, step: 2 }]
            {
                convolution.apply(&padded, y, columns, &mut Vec::new(), &mut sums);
                for (output, lanes) in sums.iter().enumerate() {
                    for (lane, x) in (columns.first..11).step_by(columns.step).take(LANES).enumerate() {
                        near(lanes[lane], convolved(&layer, &map, output, y, x));
                    }
                }
            }
        }
    }
}

#[test]
fn masked_convolutions_see_the_anchors() {
    let mut random = Random(2);
    let size = [6, 20];
    for (kernel, groups) in [(5, 1), (5, 2), (5, 4), (3, 1), (7, 2)] {
        let mut layer = random.layer(LayerKind::Checkerboard, 4, 8, kernel, groups);
        let area = (kernel * kernel) as usize;
        let mut map = Plain::random(&mut random, 4, size);
        let anchors = AnchorMap::new(&map.values, size, 0.0);
        let masked = MaskedConvolution::new(&layer);
        let odd = |at: usize, width: usize| (at / width + at % width) % 2 == 1;
        for (at, weight) in layer.weight.iter_mut().enumerate() {
            *weight = if odd(at % area, kernel as usize) { *weight } else { 0.0 };
        }
        for (at, value) in map.values.iter_mut().enumerate() {
            *value = if odd(at, size[1]) { *value } else { 0.0 };
        }
        let mut sums = vec![[0.0; LANES]; 8];
        for y in 0..size[0] {
            for first in [0, 8] {
                masked.apply(&anchors, y, first, &mut Vec::new(), &mut sums);
                for (output, lanes) in sums.iter().enumerate() {
                    for lane in 0..LANES.min(10 - first) {
                        near(lanes[lane], convolved(&layer, &map, output, y, 2 * (first + lane) + y % 2));
                    }
                }
            }
        }
    }
}

#[test]
fn transposed_convolutions() {
    let mut random = Random(3);
    let layer = random.layer(LayerKind::Doubling, 3, 5, 5, 1);
    let map = Plain::random(&mut random, 3, [2, 9]);
    let doubled = TransposedConvolution::new(&layer).apply(&map.padded(1), 2, |_| ());
    for output in 0..5 {
        let mut expected = vec![f64::from(layer.bias[output]); 4 * 18];
        for input in 0..3 {
            for y in 0..2 {
                for x in 0..9 {
                    for (tap, &weight) in layer.weight[(input * 5 + output) * 25..][..25].iter().enumerate() {
                        let (to_y, to_x) = (2 * y + tap / 5, 2 * x + tap % 5);
                        if (2..6).contains(&to_y) && (2..20).contains(&to_x) {
                            let at = (to_y - 2) * 18 + to_x - 2;
                            expected[at] += f64::from(weight) * map.at(input, y as isize, x as isize);
                        }
                    }
                }
            }
        }
        for y in 0..4 {
            doubled
                .row(output, y)
                .iter()
                .zip(&expected[18 * y..])
                .for_each(|(&found, &expected)| near(found, expected));
        }
    }
}

#[test]
fn up_sampling_aligns_corners() {
    let mut random = Random(4);
    let map = Plain::random(&mut random, 2, [3, 4]);
    let up = resized(&map.padded(0), [7, 8], 1);
    for channel in 0..2 {
        for y in 0..7 {
            for x in 0..8 {
                let (sy, sx) = (y as f64 * 2.0 / 6.0, x as f64 * 3.0 / 7.0);
                let (iy, ix) = (sy.floor(), sx.floor());
                let at = |dy: isize, dx: isize| map.at(channel, iy as isize + dy, ix as isize + dx);
                let across = |dy| at(dy, 0) * (1.0 - (sx - ix)) + at(dy, 1) * (sx - ix);
                near(up.row(channel, y)[x], across(0) * (1.0 - (sy - iy)) + across(1) * (sy - iy));
            }
        }
    }
    // One sample, and the same size.
    let one = PaddedMap::centered(&[3.0], [1, 1], 0.0, 0);
    assert_eq!(resized(&one, [1, 4], 0).row(0, 0), [3.0; 4]);
    assert_eq!(resized(&map.padded(0), [3, 4], 0).row(1, 2), &map.values[20..]);
}

#[test]
fn means_and_transposition() {
    // Two channels, three rows, four columns.
    let values: Vec<f32> = (0..24).map(|i| i as f32).collect();
    let map = PaddedMap::centered(&values, [3, 4], 0.0, 1);
    let down = mean_over_height(&map, 1);
    assert_eq!(
        (down.height, down.row(0, 0), down.row(1, 0)),
        (1, &[4.0, 5.0, 6.0, 7.0][..], &[16.0, 17.0, 18.0, 19.0][..])
    );
    let across = mean_over_width(&map, 0);
    assert_eq!((across.width, across.row(0, 1), across.row(1, 2)), (1, &[5.5][..], &[21.5][..]));
    let other = transposed(&map, 2);
    assert_eq!((other.height, other.width, other.row(1, 3)), (4, 3, &[15.0, 19.0, 23.0][..]));
}
