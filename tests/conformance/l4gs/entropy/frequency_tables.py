"""Distributions that a stream carries: "Frequency tables"."""

from __future__ import annotations

from ..errors import Refused
from ..limits import Budget
from .ans import LARGEST_SYMBOL, TOTAL, Distribution
from .range_coder import RangeDecoder, contexts

_MOST_SLOTS = 1 << 14
_LARGEST_CODE = 112


def _weight(code: int) -> int:
    return code if code < 8 else (8 + code % 8) << (code // 8 - 1)


def read_tables(part: str, field: str, data: bytes, count: int, budget: Budget) -> list[Distribution]:
    """`count` tables from the bytes of one block."""
    decoder = RangeDecoder(part, field, data)
    ends = contexts(2)
    differences = contexts(3)
    tables = []
    for _ in range(count):
        first = ends[0].read(decoder)
        slots = ends[1].read(decoder)
        if not 1 <= slots <= _MOST_SLOTS:
            raise Refused(part, field, f"1 to 2^14 slots, not {slots}")
        if abs(first) > LARGEST_SYMBOL:
            raise Refused(part, field, f"a first integer within 2^22, not {first}")
        budget.take(part, field, slots + 1, 8)
        weights = []
        code = difference = 0
        for slot in range(slots + 1):
            difference = differences[0 if slot == 0 else 1 if difference < 0 else 2].read(decoder)
            code += difference
            if not 1 <= code <= _LARGEST_CODE:
                raise Refused(part, field, f"codes from 1 to {_LARGEST_CODE}, not {code}")
            weights.append(_weight(code))
        total = sum(weights)
        begins = []
        before = 0
        for slot, weight in enumerate(weights):
            begins.append(slot + before * (TOTAL - (slots + 1)) // total)
            before += weight
        tables.append(Distribution(first, begins))
    return tables
