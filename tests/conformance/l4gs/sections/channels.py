"""Channels of integers, each Gaussian predicted from Gaussians before it: "Channels"."""

from __future__ import annotations

import numpy as np

from ..entropy.range_coder import AdaptiveInteger, RangeDecoder, contexts, level, wrapped

NEIGHBORS = 4
_LOOK_BACK = 64
_EARLIER_CHANNELS = 7
_LAST_LEVEL = 13
_LARGEST_MAGNITUDE = 1 << 16
_WEIGHT_DIGITS = 9
_HALF = 1 << _WEIGHT_DIGITS - 1
# Levels below this one know how far the prediction was rounded, in parts of half a step.
_EXACT_LEVELS = 2
_PARTS = 4


def find_neighbors(points: np.ndarray) -> np.ndarray:
    """The neighbors of each Gaussian, the nearest first: `[N, 4]` numbers of Gaussians. The first one's mean nothing.

    `points` are `[N, 3]`: integers for cells, float64 for decoded centers.
    """
    count = len(points)
    neighbors = np.zeros((count, NEIGHBORS), np.int64)
    for i in range(1, count):
        # The later ones first, so that a stable order puts them before equally distant ones.
        earlier = np.arange(i - 1, max(i - _LOOK_BACK, 0) - 1, -1)
        with np.errstate(all="ignore"):
            difference = points[earlier] - points[i]
            square = difference * difference
            distance = (square[:, 0] + square[:, 1]) + square[:, 2]
        near = np.isfinite(distance)
        earlier, distance = earlier[near], distance[near]
        if len(earlier) == 0:
            neighbors[i] = i - 1
            continue
        nearest = earlier[np.argsort(distance, kind="stable")[:NEIGHBORS]]
        neighbors[i] = nearest[0]
        neighbors[i, : len(nearest)] = nearest
    return neighbors


def read_channels(decoder: RangeDecoder, count: int, width: int, neighbors: np.ndarray, largest: int) -> np.ndarray:
    """The integers of an attribute, `[count, width]`, each at most `largest` in magnitude, in the order of the stream."""
    header = AdaptiveInteger()
    near = [[int(n) for n in row] for row in neighbors]
    # For each channel read so far, of each Gaussian: the value without the channel's center; that summed over the neighbors; the
    # magnitude of the residual, at most 2^16.
    values: list[list[int]] = []
    sums: list[list[int]] = []
    magnitudes: list[list[int]] = []
    centers: list[int] = []
    residual_contexts = contexts(_LAST_LEVEL + 1)
    sign_contexts = contexts(_EXACT_LEVELS * _PARTS + _LAST_LEVEL + 1 - _EXACT_LEVELS)
    for channel in range(width):
        center = header.read(decoder)
        centers.append(center)
        earlier = range(max(channel - _EARLIER_CHANNELS, 0), channel)
        weights = [wrapped(header.read(decoder), 16) for _ in range(2 + 2 * len(earlier))]
        own: list[int] = []
        own_sums: list[int] = []
        own_magnitudes: list[int] = []
        for i in range(count):
            around = near[i] if i else []
            own_sums.append(sum(own[n] for n in around))
            inputs = [own_sums[i], own[around[0]] if around else 0]
            for before in earlier:
                inputs += [values[before][i], sums[before][i]]
            total = sum(w * x for w, x in zip(weights, inputs))
            rounded = total + _HALF >> _WEIGHT_DIGITS
            beyond = total - (rounded << _WEIGHT_DIGITS)
            context = _LAST_LEVEL
            if around:
                activity = sum(own_magnitudes[n] for n in around)
                activity += 4 * magnitudes[-1][i] if channel else activity
                context = level(activity // 4, _LAST_LEVEL)
            sign = _EXACT_LEVELS * _PARTS + context - _EXACT_LEVELS
            if context < _EXACT_LEVELS:
                sign = _PARTS * context + min(abs(beyond) * _PARTS // _HALF, _PARTS - 1)
            residual = residual_contexts[context].read(decoder, sign_contexts[sign])
            if context < _EXACT_LEVELS and beyond < 0:
                residual = -residual
            value = wrapped(center + rounded + residual)
            if abs(value) > largest:
                decoder.refuse(f"integers of at most {largest} in magnitude")
            own.append(value - center)
            own_magnitudes.append(min(abs(residual), _LARGEST_MAGNITUDE))
        values.append(own)
        sums.append(own_sums)
        magnitudes.append(own_magnitudes)
    return (np.array(values, np.int64).reshape(width, count) + np.array(centers, np.int64).reshape(width, 1)).T
