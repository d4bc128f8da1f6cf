"""Files of the set that are made from others: bytes replaced, and then lengths and checksums that fit.

An edit replaces `length` bytes at `offset` of a part. Parts are `prelude`, `meta`, `table` and the sections by name, those of
further layers with a number, as in `gaussians_2`. After these
edits, the lengths and checksums of all sections, the numbers in the prelude and the checksum of the header are computed again.
Edits of the part `header` have offsets in the whole file; they come after that, and then only the checksum of the header is
computed again. Edits of the part `file` come last of all, and nothing is computed after them.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

from l4gs.checksum import crc32c

_NAMES = {1: "gaussians", 2: "sh", 3: "scene_coordinates", 4: "motion", 5: "feature_planes", 6: "context_model"}
_PRELUDE, _ENTRY, _CHECKSUM_AT = 32, 16, 28
_EDIT = re.compile(r"([a-z_]+[0-9]*)@(\d+)-(\d+)=((?:[0-9a-f]{2})*)")


@dataclass
class Edit:
    part: str
    offset: int
    length: int
    new: bytes

    @staticmethod
    def parse(text: str) -> Edit:
        """From `PART@OFFSET-LENGTH=HEX`."""
        match = _EDIT.fullmatch(text)
        if match is None:
            raise ValueError(f"{text!r} is not an edit, PART@OFFSET-LENGTH=HEX")
        part, offset, length, new = match.groups()
        return Edit(part, int(offset), int(length), bytes.fromhex(new))

    def apply(self, data: bytes) -> bytes:
        if self.offset + self.length > len(data):
            raise ValueError(f"an edit of {self.part} at {self.offset} is beyond its {len(data)} bytes")
        return data[: self.offset] + self.new + data[self.offset + self.length :]


def forge(data: bytes, edits: list[Edit]) -> bytes:
    """A legal stream after some edits; a take, which has no such parts, only after edits of the file."""
    if all(edit.part == "file" for edit in edits):
        for edit in edits:
            data = edit.apply(data)
        return data
    parts = split(data)
    for edit in edits:
        if edit.part not in ("header", "file"):
            parts[edit.part] = edit.apply(parts[edit.part])
    data = _join(parts)
    for edit in edits:
        if edit.part == "header":
            data = edit.apply(data)
    data = _with_checksum(data)
    for edit in edits:
        if edit.part == "file":
            data = edit.apply(data)
    return data


def split(data: bytes) -> dict[str, bytes]:
    """The parts of a legal stream by name, in their order."""
    count, meta_bytes = struct.unpack_from("<II", data, 12)
    table = _PRELUDE + meta_bytes
    at = table + _ENTRY * count
    parts = {"prelude": data[:_PRELUDE], "meta": data[_PRELUDE:table], "table": data[table:at]}
    for i in range(count):
        number, _, _, _, length = struct.unpack_from("<HBBIQ", data, table + _ENTRY * i)
        name = _NAMES[number]
        before = sum(part.split("_")[0] == name for part in parts)
        parts[f"{name}_{before + 1}" if before else name] = data[at : at + length]
        at += length
    return parts


def _join(parts: dict[str, bytes]) -> bytes:
    """The stream of these parts. Entry `i` of the table belongs to section `i`, whatever its number says."""
    sections = [data for name, data in parts.items() if name not in ("prelude", "meta", "table")]
    table = bytearray(parts["table"])
    for i, section in enumerate(sections):
        if _ENTRY * (i + 1) <= len(table):
            struct.pack_into("<IQ", table, _ENTRY * i + 4, crc32c(section), len(section))
    rest = parts["meta"] + bytes(table) + b"".join(sections)
    prelude = bytearray(parts["prelude"])
    struct.pack_into("<IIQ", prelude, 12, len(table) // _ENTRY, len(parts["meta"]), _PRELUDE + len(rest))
    return bytes(prelude) + rest


def _with_checksum(data: bytes) -> bytes:
    """The stream with the checksum of its header."""
    count, meta_bytes = struct.unpack_from("<II", data, 12)
    checksum = crc32c(data[:_CHECKSUM_AT], data[_PRELUDE : _PRELUDE + meta_bytes + _ENTRY * count])
    return data[:_CHECKSUM_AT] + struct.pack("<I", checksum) + data[_PRELUDE:]
