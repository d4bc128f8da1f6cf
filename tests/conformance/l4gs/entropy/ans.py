"""Symbols under given distributions: "Symbols: the ANS coder"."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import NoReturn

from ..errors import Refused

TOTAL_BITS = 24
TOTAL = 1 << TOTAL_BITS
LARGEST_SYMBOL = 1 << 22
_MOST_ZEROS = 23


@dataclass
class Distribution:
    """Slots of integers from `first` on; the last slot is the escape."""

    first: int
    # Where each slot begins: n + 1 numbers below 2^24, the first 0, rising.
    begins: list[int]


class SymbolDecoder:
    """Reads symbols from one sub-stream."""

    def __init__(self, part: str, field: str, data: bytes) -> None:
        self._part = part
        self._field = field
        if data and data[-1] == 0:
            self.refuse("a sub-stream whose last byte is not 0")
        padded = data + bytes(-len(data) % 4)
        self._words = [int.from_bytes(padded[at : at + 4], "little") for at in range(0, len(padded), 4)]
        self._state = 0
        while self._state < 1 << 32 and self._words:
            self._state = self._state << 32 | self._words.pop()

    def refuse(self, expectation: str) -> NoReturn:
        raise Refused(self._part, self._field, expectation)

    def _advance(self, begin: int, frequency: int) -> None:
        quantile = self._state & TOTAL - 1
        self._state = (self._state >> TOTAL_BITS) * frequency + quantile - begin
        if self._state < 1 << 32 and self._words:
            self._state = self._state << 32 | self._words.pop()

    def _bit(self) -> int:
        half = TOTAL // 2
        bit = int(self._state & TOTAL - 1 >= half)
        self._advance(half * bit, half)
        return bit

    def symbol(self, distribution: Distribution) -> int:
        begins = distribution.begins
        slot = bisect_right(begins, self._state & TOTAL - 1) - 1
        escape = len(begins) - 1
        end = begins[slot + 1] if slot < escape else TOTAL
        self._advance(begins[slot], end - begins[slot])
        if slot < escape:
            return distribution.first + slot
        symbol = self._beyond(distribution.first, escape)
        if abs(symbol) > LARGEST_SYMBOL:
            self.refuse("integers within 2^22 after an escape")
        return symbol

    def _beyond(self, first: int, count: int) -> int:
        """An integer outside of the `count` integers from `first` on."""
        above = self._bit()
        zeros = 0
        while not self._bit():
            zeros += 1
            if zeros > _MOST_ZEROS:
                self.refuse("at most 23 zeros after an escape")
        magnitude = 1
        for _ in range(zeros):
            magnitude = 2 * magnitude + self._bit()
        return first + count + magnitude - 1 if above else first - magnitude

    def end(self) -> None:
        """Refuses a sub-stream that holds more than its symbols."""
        if self._state or self._words:
            self.refuse("a sub-stream that ends with its last symbol")
