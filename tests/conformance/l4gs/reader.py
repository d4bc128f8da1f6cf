"""Fields one after the other: "Rules for the whole stream"."""

from __future__ import annotations

import struct
import unicodedata
from typing import NoReturn

import numpy as np

from . import limits
from .errors import Refused

# Marks that change the direction of writing.
_DIRECTION_MARKS = {0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)}


class Reader:
    """Reads fields from the bytes of one part of the stream, and names part and field where they break a rule."""

    def __init__(self, part: str, data: bytes, begin: int = 0) -> None:
        self.part = part
        self.data = data
        # Where the data begins in the part: the fields of an attribute or a block are read by a reader of their own.
        self.begin = begin
        self.position = 0

    def refuse(self, field: str, expectation: str) -> NoReturn:
        raise Refused(self.part, field, expectation)

    def require(self, condition: bool, field: str, expectation: str) -> None:
        if not condition:
            self.refuse(field, expectation)

    @property
    def left(self) -> int:
        return len(self.data) - self.position

    def take(self, count: int, field: str) -> bytes:
        """The next `count` bytes."""
        if count > self.left:
            self.refuse(field, f"{count} bytes, where {self.left} are left")
        begin = self.position
        self.position += count
        return self.data[begin : self.position]

    def end(self, field: str = "end") -> None:
        """Refuses bytes beyond the last field."""
        self.require(self.left == 0, field, f"no more bytes, where {self.left} are left")

    def u8(self, field: str) -> int:
        return self.take(1, field)[0]

    def u16(self, field: str) -> int:
        return int(struct.unpack("<H", self.take(2, field))[0])

    def u32(self, field: str) -> int:
        return int(struct.unpack("<I", self.take(4, field))[0])

    def u64(self, field: str) -> int:
        return int(struct.unpack("<Q", self.take(8, field))[0])

    def f64(self, field: str) -> float:
        return float(struct.unpack("<d", self.take(8, field))[0])

    def f32s(self, shape: tuple[int, ...], field: str) -> np.ndarray:
        """An array of finite float32 numbers."""
        count = 1
        for length in shape:
            count *= length
        values = np.frombuffer(self.take(4 * count, field), "<f4").astype(np.float32).reshape(shape)
        self.require(bool(np.isfinite(values).all()), field, "finite numbers")
        return values

    def f32(self, field: str) -> np.float32:
        return np.float32(self.f32s((), field))

    def varint(self, field: str, most: int = (1 << 64) - 1, least: int = 0) -> int:
        """An unsigned integer in groups of seven bits, from `least` to `most`."""
        value = shift = 0
        begin = self.position
        while True:
            byte = self.take(1, field)[0]
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                break
            self.require(shift < 70, field, "a varint below 2^64")
        self.require(byte != 0 or self.position - begin == 1, field, "a varint whose last group is not 0")
        self.require(value < 1 << 64, field, "a varint below 2^64")
        self.require(least <= value <= most, field, f"from {least} to {most}, not {value}")
        return value

    def part_of(self, length: int, field: str) -> Reader:
        """A reader of the next `length` bytes."""
        begin = self.begin + self.position
        return Reader(self.part, self.take(length, field), begin)

    def block(self, field: str) -> bytes:
        return self.take(self.varint(field), field)

    def string(self, field: str, most: int = limits.STRING_BYTES, lines: bool = False) -> str:
        """UTF-8 of at most `most` bytes after its length as `u32`; `lines`: it may have line feeds and tabs."""
        length = self.u32(field)
        self.require(length <= most, field, f"at most {most} bytes, not {length}")
        return self.text(self.take(length, field), field, lines)

    def text(self, data: bytes, field: str, lines: bool = False) -> str:
        try:
            value = data.decode("utf-8")
        except UnicodeDecodeError:
            self.refuse(field, "UTF-8")
        for character in value:
            if lines and character in "\n\t":
                continue
            legal = unicodedata.category(character) != "Cc" and ord(character) not in _DIRECTION_MARKS
            self.require(legal, field, "no control characters and no marks of the direction of writing")
        return value

    def step(self, field: str) -> np.float32:
        """A quantization step of an attribute: a normal number, at most 1e30."""
        value = self.f32(field)
        self.require(np.finfo(np.float32).tiny <= value <= np.float32(1e30), field, "a normal number, at most 1e30")
        return value
