"""Sorted cells as a binary tree of Morton codes: "Positions"."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..entropy.range_coder import AdaptiveBit, AdaptiveInteger, RangeDecoder

# From this number of codes on, a node's split is an adaptive integer.
_MANY = 16


@cache
def _splits(count: int) -> list[int]:
    """0, n, 1, n - 1, 2, ...: the numbers of codes, of `count`, with a 0, in the order in which the stream asks."""
    order = []
    for i in range(count // 2 + 1):
        order.append(i)
        if count - i != i:
            order.append(count - i)
    return order


class _Tree:
    """Reads the codes of a node after those of the nodes before it."""

    def __init__(self, decoder: RangeDecoder) -> None:
        self._decoder = decoder
        self._places: dict[tuple[int, int, int], AdaptiveBit] = {}
        self._ends: dict[tuple[int, int], AdaptiveBit] = {}
        self._differences: dict[int, AdaptiveInteger] = {}
        self.codes: list[int] = []

    def read(self, count: int, bits: int, code: int) -> None:
        """`count` codes that agree in all bits but the lowest `bits`; `code` has the others."""
        if count == 0 or bits == 0:
            self.codes.extend([code] * count)
        elif count == 1:
            lower = self._decoder.raw(min(bits, 32))
            self.codes.append(code | lower | self._decoder.raw(max(bits - 32, 0)) << 32)
        else:
            zeros = self._few(count, bits) if count < _MANY else self._many(count)
            self.read(zeros, bits - 1, code)
            self.read(count - zeros, bits - 1, code | 1 << (bits - 1))

    def _few(self, count: int, bits: int) -> int:
        order = _splits(count)
        for place, zeros in enumerate(order[:-1]):
            if self._places.setdefault((bits % 3, count, place), AdaptiveBit()).read(self._decoder):
                return zeros
        return order[-1]

    def _many(self, count: int) -> int:
        digits = count.bit_length()
        if self._ends.setdefault((digits, 0), AdaptiveBit()).read(self._decoder):
            return count
        if self._ends.setdefault((digits, 1), AdaptiveBit()).read(self._decoder):
            return 0
        context = self._differences.setdefault(digits, AdaptiveInteger())
        return min(max(count // 2 + context.read(self._decoder), 0), count)


def read_cells(decoder: RangeDecoder, count: int, bits: int) -> np.ndarray:
    """The cells of `count` Gaussians, `bits` bits an axis: `[count, 3]` integers."""
    tree = _Tree(decoder)
    tree.read(count, 3 * bits, 0)
    cells = np.zeros((count, 3), np.int64)
    for i, code in enumerate(tree.codes):
        for bit in range(bits):
            for axis in range(3):
                cells[i, axis] |= (code >> (3 * bit + 2 - axis) & 1) << bit
    return cells
