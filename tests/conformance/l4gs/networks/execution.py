"""Networks on maps `[channels, height, width]` of float32. Where a network is evaluated for one Gaussian at a time, a map of one
row holds all Gaussians side by side: such networks read no other place."""

from __future__ import annotations

from typing import Callable

import numpy as np

from .. import limits
from ..errors import Refused
from .arithmetic import F, exponential, interpolate, logarithm, without_tiny
from .description import (
    ADD,
    AFFINE,
    CHECKERBOARD,
    CLAMP,
    CONCATENATE,
    DIVIDE,
    DOUBLING,
    EXPONENTIAL,
    GROUP_MAXIMUM,
    GROUP_SUM,
    HALVING,
    LEAKY_RELU,
    LEAKY_RELU_WITH_SLOPE,
    LOGARITHM,
    MEAN_OVER_HEIGHT,
    MEAN_OVER_WIDTH,
    MULTIPLY,
    RELU,
    RESIZE,
    SELECT,
    SPREAD,
    SQUARE_ROOT,
    SUBTRACT,
    TRANSPOSE,
    Network,
    Node,
)

Size = tuple[int, int]  # height, width


def run(
    part: str, name: str, network: Network, weights: list[np.ndarray], inputs: list[np.ndarray], target: Size
) -> list[np.ndarray]:
    """The outputs of a network. `target` is the size of the plane that it describes."""
    values = [without_tiny(np.asarray(value, np.float32)) for value in inputs]
    rest = iter(weights)
    with np.errstate(all="ignore"):
        for i, node in enumerate(network.nodes):
            where = f"{name}: node {i} ({node.name})"
            read = [values[value] for value in node.inputs]
            _check_sizes(part, where, node, read, target)
            if node.operation <= CHECKERBOARD:
                result = _layer(node, read[0], without_tiny(next(rest)), without_tiny(next(rest)))
            else:
                result = _OPERATIONS[node.operation](node, read, target)
            values.append(without_tiny(result))
            if max(result.shape[1:]) > limits.SIDE:
                raise Refused(part, where, f"a height and width of at most {limits.SIDE}")
    outputs = [values[value] for value in network.outputs]
    for i, output in enumerate(outputs):
        if output.shape[1:] != target:
            raise Refused(part, f"{name}: output {i}", f"the size of the target, {target}, not {output.shape[1:]}")
    return outputs


def _check_sizes(part: str, where: str, node: Node, read: list[np.ndarray], target: Size) -> None:
    sizes = [value.shape[1:] for value in read]
    if node.operation == SPREAD:
        fits = all(length in (1, wanted) for length, wanted in zip(sizes[0], target))
        if not fits:
            raise Refused(part, where, f"a height and width of 1 or of the target, {target}, not {sizes[0]}")
    elif any(size != sizes[0] for size in sizes):
        raise Refused(part, where, f"inputs of the same height and width, not {sizes}")


# --- layers ----------------------------------------------------------------------------------------------------------


def _layer(node: Node, x: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    if node.operation == DOUBLING:
        return _transposed_convolution(x, weight, bias)
    if node.operation == CHECKERBOARD:
        taps = [(ky, kx) for ky in range(node.kernel) for kx in range(node.kernel) if (ky + kx) % 2 == 1]
    else:
        taps = [(ky, kx) for ky in range(node.kernel) for kx in range(node.kernel)]
        weight = weight.reshape(weight.shape[0], weight.shape[1], -1)
    return _convolution(node, x, weight, bias, taps)


def _convolution(
    node: Node, x: np.ndarray, weight: np.ndarray, bias: np.ndarray, taps: list[tuple[int, int]]
) -> np.ndarray:
    """`weight` is `[outputs, channels of a group, taps]`."""
    _, height, width = x.shape
    border = node.kernel // 2
    stride = 2 if node.operation == HALVING else 1
    padded = np.pad(x, ((0, 0), (border, border), (border, border)))
    of_group = weight.shape[1]
    # The first channel that each output reads.
    first = np.arange(node.outputs) // (node.outputs // node.groups) * of_group
    out_height, out_width = -(-height // stride), -(-width // stride)
    total = np.empty((node.outputs, out_height, out_width), np.float32)
    total[:] = bias[:, None, None]
    for channel in range(of_group):
        for tap, (ky, kx) in enumerate(taps):
            rows = slice(ky, ky + height, stride)
            columns = slice(kx, kx + width, stride)
            read = padded[channel, rows, columns] if node.groups == 1 else padded[first + channel, rows, columns]
            total += weight[:, channel, tap, None, None] * read
    return total


def _transposed_convolution(x: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Twice the size. `weight` is `[channels, outputs, 5, 5]`."""
    channels, height, width = x.shape
    padded = np.pad(x, ((0, 0), (1, 1), (1, 1)))
    total = np.empty((bias.size, 2 * height, 2 * width), np.float32)
    total[:] = bias[:, None, None]
    # Outputs of one parity of row and column read the same taps.
    for row in range(2):
        for column in range(2):
            part = total[:, row::2, column::2]
            for channel in range(channels):
                for ky in range(row, 5, 2):
                    for kx in range(column, 5, 2):
                        y = 1 + (row + 2 - ky) // 2
                        x0 = 1 + (column + 2 - kx) // 2
                        part += (
                            weight[channel, :, ky, kx, None, None] * padded[channel, y : y + height, x0 : x0 + width]
                        )
    return total


# --- other operations: (node, inputs, target) -> result -----------------------------------------------------------------


def _kept(number: float) -> np.ndarray:
    """A number of a node, or 0 where it is tiny."""
    return without_tiny(np.array(number, np.float32))


def _leaky(node: Node, read: list[np.ndarray], _: Size) -> np.ndarray:
    x = read[0]
    return np.where(x >= 0, x, _kept(node.first) * x)


def _resize(_: Node, read: list[np.ndarray], target: Size) -> np.ndarray:
    x = read[0]
    row, next_row, row_share = _resize_axis(x.shape[1], target[0])
    column, next_column, column_share = _resize_axis(x.shape[2], target[1])
    upper = interpolate(x[:, row][:, :, column], x[:, row][:, :, next_column], column_share)
    lower = interpolate(x[:, next_row][:, :, column], x[:, next_row][:, :, next_column], column_share)
    return interpolate(upper, lower, row_share[:, None])


def _resize_axis(n: int, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each of `m` samples among `n`: the sample before it, the one after that, and the share of the latter."""
    steps = max(m - 1, 1)
    at = np.arange(m, dtype=np.int64) * (n - 1)
    before = at // steps
    return before, np.minimum(before + 1, n - 1), (at % steps).astype(np.float32) / F(steps)


def _mean_over_height(_: Node, read: list[np.ndarray], __: Size) -> np.ndarray:
    x = read[0]
    total = x[:, 0:1].copy()
    for row in range(1, x.shape[1]):
        total += x[:, row : row + 1]
    return total / F(x.shape[1])


def _mean_over_width(node: Node, read: list[np.ndarray], target: Size) -> np.ndarray:
    return _mean_over_height(node, [read[0].transpose(0, 2, 1)], target).transpose(0, 2, 1)


def _pair(
    apply: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> Callable[[Node, list[np.ndarray], Size], np.ndarray]:
    """Channel `c` of the first input with channel `c mod C2` of the second."""

    def operation(_: Node, read: list[np.ndarray], __: Size) -> np.ndarray:
        first, second = read
        return apply(first, np.tile(second, (first.shape[0] // second.shape[0], 1, 1)))

    return operation


def _clamp(node: Node, read: list[np.ndarray], _: Size) -> np.ndarray:
    x, least, most = read[0], _kept(node.first), _kept(node.second)
    return np.where(x < least, least, np.where(x > most, most, x))


def _group_sum(node: Node, read: list[np.ndarray], _: Size) -> np.ndarray:
    total = read[0][:: node.size].copy()
    for i in range(1, node.size):
        total += read[0][i :: node.size]
    return total


def _group_maximum(node: Node, read: list[np.ndarray], _: Size) -> np.ndarray:
    most = read[0][:: node.size]
    for i in range(1, node.size):
        other = read[0][i :: node.size]
        most = np.where(other > most, other, most)
    return most


_OPERATIONS: dict[int, Callable[[Node, list[np.ndarray], Size], np.ndarray]] = {
    RELU: lambda node, read, target: np.where(read[0] >= 0, read[0], F(0)),
    LEAKY_RELU: _leaky,
    LEAKY_RELU_WITH_SLOPE: _leaky,
    RESIZE: _resize,
    MEAN_OVER_HEIGHT: _mean_over_height,
    MEAN_OVER_WIDTH: _mean_over_width,
    TRANSPOSE: lambda node, read, target: read[0].transpose(0, 2, 1),
    SPREAD: lambda node, read, target: np.broadcast_to(read[0], (read[0].shape[0], *target)),
    CONCATENATE: lambda node, read, target: np.concatenate(read),
    ADD: _pair(np.add),
    MULTIPLY: _pair(np.multiply),
    SUBTRACT: _pair(np.subtract),
    DIVIDE: _pair(np.divide),
    EXPONENTIAL: lambda node, read, target: exponential(read[0]),
    LOGARITHM: lambda node, read, target: logarithm(read[0]),
    SQUARE_ROOT: lambda node, read, target: np.sqrt(read[0]),
    AFFINE: lambda node, read, target: read[0] * _kept(node.first) + _kept(node.second),
    CLAMP: _clamp,
    GROUP_SUM: _group_sum,
    GROUP_MAXIMUM: _group_maximum,
    SELECT: lambda node, read, target: np.concatenate([read[0][first : first + length] for first, length in node.runs]),
}
