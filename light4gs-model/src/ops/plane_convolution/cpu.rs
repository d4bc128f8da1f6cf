//! Convolutions of planes on a CPU: products of the weights with shifted copies of the larger plane, one for each tap.

use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use rayon::prelude::*;

use super::{ConvolutionTensors, Convolved, PlaneConvolution, PlaneConvolutionKernels, Sizes};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

impl Sizes {
    /// Where the row `row` of the smaller plane meets the larger one through the tap `[down, right]`: its row there, and the columns
    /// of the smaller plane whose columns there exist, with the first of them in the larger plane. `None` beyond the border.
    fn run(&self, row: usize, [down, right]: [usize; 2]) -> Option<(usize, std::ops::Range<usize>, usize)> {
        let before = self.kernel / 2;
        let source = (row * self.stride + down).checked_sub(before).filter(|row| *row < self.large[1])?;
        let first = before.saturating_sub(right).div_ceil(self.stride);
        let end = (self.large[2] + before).saturating_sub(right).div_ceil(self.stride).min(self.small[2]);
        (first < end).then(|| (source, first..end, first * self.stride + right - before))
    }

    /// For each tap the larger plane shifted by it, `[channels · taps, places]`, with zeros beyond the borders.
    fn copies(&self, large: &[f32]) -> Vec<f32> {
        let taps = self.taps();
        let places = self.places();
        let mut copies = vec![0.0; self.large[0] * taps.len() * places];
        let planes = large.par_chunks(self.large[1] * self.large[2]);
        copies.par_chunks_mut(taps.len() * places).zip(planes).for_each(|(copies, plane)| {
            for (copy, tap) in copies.chunks_exact_mut(places).zip(&taps) {
                for (row, copy) in copy.chunks_exact_mut(self.small[2]).enumerate() {
                    let Some((source, columns, start)) = self.run(row, *tap) else { continue };
                    let source = &plane[source * self.large[2] + start..(source + 1) * self.large[2]];
                    if self.stride == 1 {
                        copy[columns.clone()].copy_from_slice(&source[..columns.len()]);
                    } else {
                        copy[columns]
                            .iter_mut()
                            .zip(source.iter().step_by(self.stride))
                            .for_each(|(to, from)| *to = *from);
                    }
                }
            }
        });
        copies
    }

    /// The larger plane as the sum of copies, each shifted back: the transpose of [`Self::copies`].
    fn sum_of_copies(&self, copies: &[f32]) -> Vec<f32> {
        let taps = self.taps();
        let places = self.places();
        let mut large = vec![0.0; self.large.iter().product()];
        let planes = large.par_chunks_mut(self.large[1] * self.large[2]);
        planes.zip(copies.par_chunks(taps.len() * places)).for_each(|(plane, copies)| {
            for (copy, tap) in copies.chunks_exact(places).zip(&taps) {
                for (row, copy) in copy.chunks_exact(self.small[2]).enumerate() {
                    let Some((source, columns, start)) = self.run(row, *tap) else { continue };
                    let sums = &mut plane[source * self.large[2] + start..(source + 1) * self.large[2]];
                    sums.iter_mut().step_by(self.stride).zip(&copy[columns]).for_each(|(sum, value)| *sum += value);
                }
            }
        });
        large
    }

    /// Inputs of an output: channels of a group times taps.
    fn depth(&self) -> usize {
        self.inputs_of_group() * self.taps().len()
    }

    /// The weights of the taps that are used, `[groups, outputs of a group, depth]`.
    fn matrix<B: HostBackend>(&self, weight: FloatTensor<B>) -> FloatTensor<B> {
        let shape = Shape::from([self.groups, self.outputs_of_group(), self.depth()]);
        if !self.checkerboard {
            return B::float_reshape(weight, shape);
        }
        let weight = B::to_host(weight);
        let kernels = weight.as_slice().chunks_exact(self.kernel * self.kernel);
        let taps = self.taps();
        let used = kernels.flat_map(|kernel| taps.iter().map(|[row, column]| kernel[row * self.kernel + column]));
        B::from_values(used.collect(), shape)
    }

    /// [`Self::matrix`] back in the layout of the weights, with zeros for taps that are not used.
    fn weight_of<B: HostBackend>(&self, matrix: FloatTensor<B>) -> FloatTensor<B> {
        let shape = Shape::from([self.small[0], self.inputs_of_group(), self.kernel, self.kernel]);
        if !self.checkerboard {
            return B::float_reshape(matrix, shape);
        }
        let matrix = B::to_host(matrix);
        let taps = self.taps();
        let area = self.kernel * self.kernel;
        let mut weight = vec![0.0; self.small[0] * self.inputs_of_group() * area];
        for (kernel, used) in weight.chunks_exact_mut(area).zip(matrix.as_slice().chunks_exact(taps.len())) {
            taps.iter().zip(used).for_each(|([row, column], value)| kernel[row * self.kernel + column] = *value);
        }
        B::from_values(weight, shape)
    }

    /// The copies of the larger plane, `[groups, depth, places]`.
    fn copies_of<B: HostBackend>(&self, large: FloatTensor<B>) -> FloatTensor<B> {
        let shape = Shape::from([self.groups, self.depth(), self.places()]);
        if self.kernel == 1 && self.stride == 1 {
            return B::float_reshape(large, shape);
        }
        B::from_values(self.copies(B::to_host(large).as_slice()), shape)
    }

    /// The larger plane that a smaller one spreads to: the gradient of the convolution by its input.
    fn spread<B: HostBackend>(&self, matrix: FloatTensor<B>, small: FloatTensor<B>) -> FloatTensor<B> {
        let small = B::float_reshape(small, Shape::from([self.groups, self.outputs_of_group(), self.places()]));
        let copies = B::float_matmul(B::float_swap_dims(matrix, 1, 2), small);
        let shape = Shape::from(self.large);
        if self.kernel == 1 && self.stride == 1 {
            return B::float_reshape(copies, shape);
        }
        B::from_values(self.sum_of_copies(B::to_host(copies).as_slice()), shape)
    }
}

/// Zeros where row + column is odd.
fn clear_anchors(plane: &mut [f32], width: usize) {
    for (row, values) in plane.chunks_exact_mut(width.max(1)).enumerate() {
        values.iter_mut().skip(1 - row % 2).step_by(2).for_each(|value| *value = 0.0);
    }
}

fn forward<B: HostBackend>(tensors: ConvolutionTensors<B>, convolution: PlaneConvolution) -> FloatTensor<B> {
    let sizes = Sizes::of::<B>(&tensors.plane, &tensors.weight, convolution);
    let ConvolutionTensors { plane, weight, bias } = tensors;
    let matrix = sizes.matrix::<B>(weight);
    let output = if convolution.transposed {
        sizes.spread::<B>(matrix, plane)
    } else {
        B::float_matmul(matrix, sizes.copies_of::<B>(plane))
    };
    let [channels, height, width] = sizes.output(convolution.transposed);
    let bias = B::to_host(bias);
    let mut output = B::to_host(B::float_reshape(output, Shape::from([channels, height, width])));
    let planes = output.as_mut_slice().par_chunks_mut((height * width).max(1));
    planes.zip(bias.as_slice()).for_each(|(plane, bias)| {
        for value in &mut *plane {
            let sum = *value + bias;
            *value = if sum > 0.0 { sum } else { convolution.slope * sum };
        }
        if convolution.without_anchors {
            clear_anchors(plane, width);
        }
    });
    B::from_host(output)
}

fn backward<B: HostBackend>(saved: Convolved<B>, gradient: FloatTensor<B>) -> ConvolutionTensors<B> {
    let Convolved { plane, weight, output, convolution } = saved;
    let sizes = Sizes::of::<B>(&plane, &weight, convolution);
    let [channels, height, width] = sizes.output(convolution.transposed);
    let mut gradient = B::to_host(gradient);
    if convolution.without_anchors {
        gradient.as_mut_slice().par_chunks_mut((height * width).max(1)).for_each(|plane| clear_anchors(plane, width));
    }
    if convolution.slope != 1.0 {
        // The output has the sign of what went into the leaky ReLU.
        let output = B::to_host(output);
        let values = gradient.as_mut_slice().par_iter_mut().zip(output.as_slice());
        values.for_each(|(gradient, output)| *gradient *= if *output > 0.0 { 1.0 } else { convolution.slope });
    }
    let of_bias = gradient.as_slice().chunks((height * width).max(1)).map(|plane| plane.iter().sum()).collect();
    let bias = B::from_values(of_bias, [channels]);
    let gradient = B::from_host(gradient);
    let matrix = sizes.matrix::<B>(weight);
    let small = |small| B::float_reshape(small, Shape::from([sizes.groups, sizes.outputs_of_group(), sizes.places()]));
    let (plane, of_matrix) = if convolution.transposed {
        let copies = sizes.copies_of::<B>(gradient);
        let of_matrix = B::float_matmul(small(plane), B::float_swap_dims(copies.clone(), 1, 2));
        (B::float_reshape(B::float_matmul(matrix, copies), Shape::from(sizes.small)), of_matrix)
    } else {
        let copies = sizes.copies_of::<B>(plane);
        let of_matrix = B::float_matmul(small(gradient.clone()), B::float_swap_dims(copies, 1, 2));
        (sizes.spread::<B>(matrix, gradient), of_matrix)
    };
    ConvolutionTensors { plane, weight: sizes.weight_of::<B>(of_matrix), bias }
}

for_cpu_back_ends! {
    PlaneConvolutionKernels {
        fn plane_convolution_forward(
            tensors: ConvolutionTensors<Self>,
            convolution: PlaneConvolution,
        ) -> FloatTensor<Self> {
            forward(tensors, convolution)
        }

        fn plane_convolution_backward(
            saved: Convolved<Self>,
            gradient: FloatTensor<Self>,
        ) -> ConvolutionTensors<Self> {
            backward(saved, gradient)
        }
    }
}
