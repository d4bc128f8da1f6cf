"""CRC-32C (Castagnoli), as in "Rules for the whole stream"."""

from __future__ import annotations

_POLYNOMIAL = 0x82F63B78


def _table() -> list[int]:
    """The remainder of each single byte."""
    table = []
    for byte in range(256):
        remainder = byte
        for _ in range(8):
            remainder = (remainder >> 1) ^ (_POLYNOMIAL if remainder & 1 else 0)
        table.append(remainder)
    return table


_TABLE = _table()


def crc32c(*parts: bytes) -> int:
    """The checksum of all parts, one after the other."""
    remainder = 0xFFFFFFFF
    table = _TABLE
    for part in parts:
        for byte in part:
            remainder = table[(remainder ^ byte) & 0xFF] ^ (remainder >> 8)
    return remainder ^ 0xFFFFFFFF
