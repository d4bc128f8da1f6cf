"""Where each field of a stream lies, as the decoder of this folder reads it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Iterator
from unittest import mock

from l4gs.decoder import decode
from l4gs.reader import Reader


@dataclass(frozen=True)
class Field:
    """Bytes that were read under one name. An offset counts from the beginning of the part."""

    part: str
    name: str
    offset: int
    length: int


@cache
def fields(data: bytes) -> tuple[Field, ...]:
    """The fields of a legal stream, in the order in which they are read. A block has two: its length, and its bytes."""
    found: list[Field] = []
    take = Reader.take
    # A varint is read byte by byte, and goes on after a byte of 128 or more.
    goes_on = False

    def taking(reader: Reader, count: int, name: str) -> bytes:
        nonlocal goes_on
        offset = reader.begin + reader.position
        taken = take(reader, count, name)
        if goes_on and count == 1 and found[-1].name == name and found[-1].offset + found[-1].length == offset:
            before = found.pop()
            found.append(Field(before.part, before.name, before.offset, before.length + 1))
        else:
            found.append(Field(reader.part, name, offset, count))
        goes_on = count == 1 and taken[0] >= 0x80
        return taken

    with mock.patch.object(Reader, "take", taking):
        decode(data)
    return tuple(found)


def lines(data: bytes) -> Iterator[str]:
    for field in fields(data):
        yield f"{field.part} {field.offset} {field.length} {field.name}"
