"""float32 arithmetic whose every operation is rounded, as networks use it. NumPy rounds each of these operations alone."""

from __future__ import annotations

import numpy as np

F = np.float32
_SMALLEST = F(2.0**-50)


def without_tiny(values: np.ndarray) -> np.ndarray:
    """The values; 0 in place of those whose magnitude is below 2^-50."""
    return np.where(np.abs(values) < _SMALLEST, F(0), values).astype(np.float32, copy=False)


_LOG2_HIGH = F(0.693359375)
_LOG2_LOW = F(-0.000212194440)


def exponential(x: np.ndarray) -> np.ndarray:
    """`exp(x)` in the document's order."""
    shift = F(12582912)
    k = (x * F(1.4426950408889634) + shift) - shift
    r = (x - k * _LOG2_HIGH) - k * _LOG2_LOW
    p = np.zeros_like(x)
    for divisor in (5040, 720, 120, 24, 6, 2):
        p = (p + F(1.0 / divisor)) * r
    power = np.ldexp(F(1), np.clip(np.nan_to_num(k) - 1, -100, 127).astype(np.int32)).astype(np.float32)
    result = (((r + p * r) + F(1)) * power) * F(2)
    result = np.where(x < F(-40), F(0), result)
    result = np.where(x > F(88.72283), F(np.inf), result)
    return np.where(np.isnan(x), x, result).astype(np.float32)


def logarithm(x: np.ndarray) -> np.ndarray:
    """`ln(x)` in the document's order."""
    usual = np.isfinite(x) & (x > 0)
    m, exponent = np.frexp(np.where(usual, x, F(1)))
    m = (m * F(2)).astype(np.float32)
    e = (exponent - 1).astype(np.float32)
    large = m > F(1.41421356237)
    m = np.where(large, m * F(0.5), m)
    e = np.where(large, e + F(1), e)
    s = (m - F(1)) / (m + F(1))
    q = s * s
    p = np.zeros_like(s)
    for divisor in (11, 9, 7, 5, 3):
        p = (p + F(1.0 / divisor)) * q
    result = ((s + s * p) * F(2) + e * _LOG2_LOW) + e * _LOG2_HIGH
    result = np.where(usual, result, x)
    result = np.where(x == 0, F(-np.inf), result)
    return np.where(x < 0, F(np.nan), result).astype(np.float32)


def interpolate(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """From `a` at share 0 to `b` at share 1."""
    return a * (F(1) - share) + b * share
