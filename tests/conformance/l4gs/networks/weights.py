"""Weights of networks and tensors, in either encoding: "Networks" and "Weights, quantized"."""

from __future__ import annotations

from math import prod

import numpy as np

from .. import limits
from ..container import FLOAT32
from ..entropy.range_coder import RangeDecoder, contexts, level, wrapped
from ..limits import Budget
from ..reader import Reader
from .description import Network

_LAST_LEVEL = 24
_LARGEST_INTEGER = 1 << 23


def read_weights(
    reader: Reader, networks: list[Network], tensors: list[tuple[int, ...]], encoding: int, budget: Budget
) -> tuple[list[list[np.ndarray]], list[np.ndarray]]:
    """To the end of the reader: the weights of each network, and then the tensors, which have the given shapes."""
    shapes = [network.weight_shapes() for network in networks]
    lengths = [prod(shape) for shape in sum(shapes, []) + tensors]
    reader.require(sum(lengths) <= limits.WEIGHTS, "weights", f"at most {limits.WEIGHTS}")
    budget.take(reader.part, "weights", sum(lengths), 4 if encoding == FLOAT32 else 8)
    if encoding == FLOAT32:
        flat = [reader.f32s((length,), "weights") for length in lengths]
        reader.end("weights")
    else:
        flat = _read_quantized(reader, lengths)
    rest = iter(flat)
    of_networks = [[next(rest).reshape(shape) for shape in of_one] for of_one in shapes]
    return of_networks, [next(rest).reshape(shape) for shape in tensors]


def _read_quantized(reader: Reader, lengths: list[int]) -> list[np.ndarray]:
    least = -(-sum(lengths) // 256)
    reader.require(
        reader.left >= least, "weights", f"at least {least} bytes for {sum(lengths)} weights, not {reader.left}"
    )
    decoder = RangeDecoder(reader.part, "weights", reader.take(reader.left, "weights"))
    shared = contexts(_LAST_LEVEL + 1)
    tensors = []
    for length in lengths:
        if length == 0:
            tensors.append(np.zeros(0, np.float32))
            continue
        step = np.array(decoder.raw(32), np.uint32).view(np.float32)
        if step == 0:
            tensors.append(np.zeros(length, np.float32))
            continue
        reader.require(
            bool(np.finfo(np.float32).tiny <= step <= np.float32(1e30)),
            "weights: step",
            "a normal number, at most 1e30",
        )
        order = decoder.raw(2)
        reader.require(order <= 2, "weights: order of the prediction", "0 to 2, not 3")
        row = (decoder.raw(16) or length) if order else length
        integers = np.array(_read_integers(decoder, shared, length, order, row), np.int64)
        legal = bool((np.abs(integers) <= _LARGEST_INTEGER).all())
        reader.require(legal, "weights", f"integers of at most {_LARGEST_INTEGER} in magnitude")
        values = integers.astype(np.float32) * step
        tensors.append(values)
    return tensors


def _read_integers(decoder: RangeDecoder, shared: list, length: int, order: int, row: int) -> list[int]:
    """The integers of one tensor, each 32 bits with a sign."""
    integers: list[int] = []
    mean = 256
    for i in range(length):
        difference = shared[level(mean // 4, _LAST_LEVEL)].read(decoder)
        usable = min(order, i % row)
        prediction = 0
        if usable == 1:
            prediction = integers[-1]
        elif usable == 2:
            prediction = 2 * integers[-1] - integers[-2]
        integers.append(wrapped(prediction + difference))
        mean = (15 * mean + 16 * abs(difference) + 8) // 16
    return integers
