"""The range coder, adaptive bits and adaptive integers: "The range coder"."""

from __future__ import annotations

from ..errors import Refused

_TOTAL_BITS = 15
_TOTAL = 1 << _TOTAL_BITS
_MASK = (1 << 64) - 1
_RAW_CHUNK = 12
# No sound stream needs more words of zeros after its own.
_WORDS_BEYOND_THE_END = 4


class RangeDecoder:
    """Finds intervals that divide 0 to 2^15, in a stream of 16-bit words."""

    def __init__(self, part: str, field: str, data: bytes) -> None:
        self._part = part
        self._field = field
        self._words = [int.from_bytes(data[at : at + 2], "little") for at in range(0, len(data), 2)]
        self._next = 0
        self._lower = 0
        self._range = _MASK
        self._point = 0
        for _ in range(4):
            self._point = self._point << 16 | self._word()

    def refuse(self, expectation: str) -> None:
        raise Refused(self._part, self._field, expectation)

    def _word(self) -> int:
        at = self._next
        self._next += 1
        if at < len(self._words):
            return self._words[at]
        if at >= len(self._words) + _WORDS_BEYOND_THE_END:
            self.refuse(f"range-coded bytes that are enough, with {_WORDS_BEYOND_THE_END} words of zeros after them")
        return 0

    def _quantile(self) -> tuple[int, int]:
        """Where the point lies among 2^15 parts of the range, and the size of a part."""
        scale = self._range >> _TOTAL_BITS
        quantile = ((self._point - self._lower) & _MASK) // scale
        if quantile >= _TOTAL:
            self.refuse("range-coded bytes whose point lies within the range")
        return quantile, scale

    def _choose(self, begin: int, width: int, scale: int) -> None:
        """Takes the interval `[begin, begin + width)`."""
        self._lower = (self._lower + scale * begin) & _MASK
        self._range = scale * width
        if self._range < 1 << 48:
            self._lower = self._lower << 16 & _MASK
            self._range <<= 16
            self._point = (self._point << 16 & _MASK) | self._word()

    def bit(self, probability: int) -> int:
        """One decision; `probability` of a one, in units of 2^-15."""
        quantile, scale = self._quantile()
        zeros = _TOTAL - probability
        if quantile < zeros:
            self._choose(0, zeros, scale)
            return 0
        self._choose(zeros, probability, scale)
        return 1

    def raw(self, bits: int) -> int:
        """An unsigned integer of `bits` bits, in chunks of 12, the lowest first."""
        value = shift = 0
        while shift < bits:
            chunk = min(_RAW_CHUNK, bits - shift)
            quantile, scale = self._quantile()
            width = _TOTAL >> chunk
            digits = quantile // width
            self._choose(digits * width, width, scale)
            value |= digits << shift
            shift += chunk
        return value


class AdaptiveBit:
    """A bit whose probability follows the bits before it, by a fast and a slow estimate in units of 2^-16."""

    __slots__ = ("_fast", "_slow", "_count")

    def __init__(self) -> None:
        self._fast = 1 << 15
        self._slow = 1 << 15
        self._count = 0

    def read(self, decoder: RangeDecoder) -> int:
        probability = min(max((self._fast + self._slow) // 4, 16), 32752)
        bit = decoder.bit(probability)
        target = 65535 if bit else 0
        fast_rate = (1 << 17) // (2 * min(self._count, 18) + 3)
        slow_rate = (1 << 17) // (2 * self._count + 3)
        self._fast += ((target - self._fast) * fast_rate) >> 16
        self._slow += ((target - self._slow) * slow_rate) >> 16
        self._count = min(self._count + 1, 250)
        return bit


_LONGEST = 31
_EXPONENTS_WITH_TREE = 12


class AdaptiveInteger:
    """One context of adaptive integers."""

    __slots__ = ("_zero", "_negative", "_longer", "_trees")

    def __init__(self) -> None:
        self._zero = AdaptiveBit()
        self._negative = AdaptiveBit()
        self._longer = [AdaptiveBit() for _ in range(_LONGEST)]
        self._trees = [[AdaptiveBit() for _ in range(8)] for _ in range(_EXPONENTS_WITH_TREE)]

    def read(self, decoder: RangeDecoder, sign: AdaptiveInteger | None = None) -> int:
        """The next integer; whether it is 0 and its sign under another context, if one is given."""
        sign = sign or self
        if sign._zero.read(decoder):
            return 0
        negative = sign._negative.read(decoder)
        exponent = 0
        while exponent < _LONGEST and self._longer[exponent].read(decoder):
            exponent += 1
        upper_bits = min(exponent, 3) if exponent < _EXPONENTS_WITH_TREE else 0
        node = 1
        for _ in range(upper_bits):
            node = 2 * node + self._trees[exponent][node].read(decoder)
        # The node is a one and then the digits that were read.
        lower_bits = exponent - upper_bits
        magnitude = node << lower_bits | decoder.raw(lower_bits)
        return wrapped(-magnitude if negative else magnitude)


def wrapped(integer: int, bits: int = 32) -> int:
    """The lowest bits of an integer, as an integer with a sign."""
    half = 1 << (bits - 1)
    return (integer + half) % (2 * half) - half


def contexts(count: int) -> list[AdaptiveInteger]:
    """A set of contexts that share no state."""
    return [AdaptiveInteger() for _ in range(count)]


def level(magnitude: int, last: int) -> int:
    """The level of a magnitude: two for each power of two, at most `last`."""
    if magnitude < 2:
        return min(magnitude, last)
    length = magnitude.bit_length() - 1
    return min(2 * length + 1 + (magnitude >> (length - 1) & 1), last)
