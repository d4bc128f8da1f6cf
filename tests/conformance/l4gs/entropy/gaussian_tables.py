"""The 128 distributions of rounded Gaussians: "Gaussians" under "Symbols". All in float64."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from .ans import TOTAL, Distribution

LEVELS = 128


def _scales() -> list[float]:
    scales = [0.11]
    while len(scales) < LEVELS:
        scales.append(scales[-1] * 1.062944547489952)
    return scales


_SCALES = _scales()
# [127] float32: a scale has level i if exactly i of them are less.
_THRESHOLDS = np.array([scale * 1.0309920210602757 for scale in _SCALES[:-1]], np.float64).astype(np.float32)


def levels(scales: np.ndarray) -> np.ndarray:
    """The level of each scale, a float32 of any value: the same shape, integers."""
    found = np.searchsorted(_THRESHOLDS, scales, side="left")
    return np.where(np.isnan(scales), 0, found)


def _normal(x: float) -> float:
    """The distribution function of the standard normal variable for `x >= 0`."""
    if x > 8.0:
        return 1.0
    t = a = x
    d = 1.0
    while t > 1e-17 * a:
        d = d + 2.0
        t = t * (x * x / d)
        a = a + t
    y = (0.5 * (x * x)) / 64.0
    p = g = 1.0
    for n in range(1, 19):
        p = p * (-y / n)
        g = g + p
    for _ in range(6):
        g = g * g
    return 0.5 + 0.3989422804014327 * g * a


@cache
def distribution(level: int) -> Distribution:
    """The distribution of a level."""
    scale = _SCALES[level]
    radius = math.floor(6.0 * scale) + 1
    above = [_normal((k + 0.5) / scale) for k in range(radius + 1)]

    def edge(k: int) -> float:
        return above[k] if k >= 0 else 1.0 - above[-k - 1]

    slots = 2 * radius + 1
    spread = TOTAL - (slots + 1)
    lowest = edge(-radius - 1)
    whole = edge(radius) - lowest
    # The series may round to slightly more than 1, and its rest to less than 0.
    begins = [i + math.floor(max((edge(i - radius - 1) - lowest) / whole * spread, 0.0)) for i in range(slots)]
    return Distribution(-radius, begins + [TOTAL - 1])
