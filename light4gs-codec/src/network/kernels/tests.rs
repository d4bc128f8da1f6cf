//! Every operation against its definition in float64.

use super::*;
use crate::{ConvolutionLayer, ConvolutionShape, context_model::CONTEXT_PREDICTION};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    fn numbers(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.next()).collect()
    }

    fn layer(&mut self, inputs: u32, outputs: u32, kernel: u32, groups: u32, transposed: bool) -> ConvolutionLayer {
        let shape = ConvolutionShape { name: CONTEXT_PREDICTION, outputs, inputs, kernel, groups, transposed };
        let weight = self.numbers(shape.weights() as usize);
        ConvolutionLayer { shape, weight, bias: self.numbers(outputs as usize) }
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
        PaddedMap::centred(&self.values, self.size, 0.0, border)
    }
}

/// The definition of a convolution of stride 1.
fn convolved(layer: &ConvolutionLayer, map: &Plain, output: usize, y: usize, x: usize) -> f64 {
    let ConvolutionShape { inputs, outputs, kernel, groups, .. } = layer.shape;
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
    for (inputs, outputs, kernel, groups) in [(3, 5, 3, 1), (4, 8, 5, 4), (4, 6, 1, 2), (6, 9, 3, 3), (2, 4, 7, 1)] {
        let layer = random.layer(inputs, outputs, kernel, groups, false);
        let map = Plain::random(&mut random, inputs as usize, [5, 11]);
        let convolution = Convolution::new(&layer);
        let padded = map.padded(convolution.border());
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
    for groups in [1, 2, 4] {
        let mut layer = random.layer(4, 8, 5, groups, false);
        let mut map = Plain::random(&mut random, 4, size);
        let anchors = AnchorMap::new(&map.values, size, 0.0);
        let masked = MaskedConvolution::new(&layer);
        let odd = |at: usize, width: usize| (at / width + at % width) % 2 == 1;
        for (at, weight) in layer.weight.iter_mut().enumerate() {
            *weight = if odd(at % 25, 5) { *weight } else { 0.0 };
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
    let layer = random.layer(3, 5, 5, 1, true);
    let map = Plain::random(&mut random, 3, [2, 9]);
    let doubled = transposed::TransposedConvolution::new(&layer).apply(&map.padded(1), 2, |_| ());
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
    let up = upsample(&map.values, [3, 4], [7, 8], 0.25, 1);
    for channel in 0..2 {
        for y in 0..7 {
            for x in 0..8 {
                let (sy, sx) = (y as f64 * 2.0 / 6.0, x as f64 * 3.0 / 7.0);
                let (iy, ix) = (sy.floor(), sx.floor());
                let at = |dy: isize, dx: isize| map.at(channel, iy as isize + dy, ix as isize + dx);
                let across = |dy| at(dy, 0) * (1.0 - (sx - ix)) + at(dy, 1) * (sx - ix);
                near(up.row(channel, y)[x], across(0) * (1.0 - (sy - iy)) + across(1) * (sy - iy) - 0.25);
            }
        }
    }
    // One sample, and the same size.
    assert_eq!(upsample(&[3.0], [1, 1], [1, 4], 0.0, 0).row(0, 0), [3.0; 4]);
    assert_eq!(upsample(&map.values, [3, 4], [3, 4], 0.0, 0).row(1, 2), &map.values[20..]);
}

#[test]
fn time_means_are_spread() {
    // Two channels, three times; four places along the first axis, two along the second.
    let first: Vec<f32> = (0..24).map(|i| i as f32).collect();
    let second: Vec<f32> = (0..12).map(|i| 100.0 + i as f32).collect();
    let first = time_means(&first, [3, 4], 1.0);
    let second = time_means(&second, [3, 2], 1.0);
    assert_eq!(first, [3.0, 4.0, 5.0, 6.0, 15.0, 16.0, 17.0, 18.0]);
    let map = spread_time_means(&first, &second, [2, 4], 1);
    assert_eq!((map.channels, map.row(1, 0), map.row(1, 1)), (4, &first[4..], &first[4..]));
    assert_eq!((map.row(2, 0), map.row(2, 1)), (&[101.0; 4][..], &[102.0 + 1.0 - 1.0; 4][..]));
}

#[test]
fn a_context_of_zeros_may_be_left_out() {
    let mut random = Random(5);
    let layers = [random.layer(8, 7, 1, 1, false), random.layer(7, 5, 1, 1, false), random.layer(5, 4, 1, 1, false)];
    let network = EntropyParameters::new(layers.each_ref());
    let mut inputs = vec![[0.0; LANES]; 8];
    inputs[..4].iter_mut().flatten().for_each(|value| *value = random.next());
    let mut with = vec![[0.0; LANES]; 4];
    let mut without = with.clone();
    network.apply(&inputs, &mut Default::default(), &mut with);
    network.apply(&inputs[..4], &mut Default::default(), &mut without);
    assert_eq!(with, without);

    let sum = |layer: &ConvolutionLayer, inputs: &[f64], output: usize| {
        let row = layer.weight[output * inputs.len()..].iter().zip(inputs);
        row.fold(f64::from(layer.bias[output]), |sum, (&weight, input)| sum + f64::from(weight) * input)
    };
    let mut values: Vec<f64> = inputs.iter().map(|lanes| f64::from(lanes[3])).collect();
    for (index, layer) in layers.iter().enumerate() {
        values = (0..layer.shape.outputs as usize).map(|output| sum(layer, &values, output)).collect();
        if index < 2 {
            values.iter_mut().for_each(|value| *value = if *value < 0.0 { 0.01 * *value } else { *value });
        }
    }
    with.iter().zip(values).for_each(|(lanes, expected)| near(lanes[3], expected));
}
