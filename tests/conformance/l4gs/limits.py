"""The limits of the reference reader: "Limits" of docs/format.md.

Counts are compared before anything of that size is taken. `Budget` adds up the memory that the numbers of all sections need.
The document's times are those of the reference reader's own code, so there is no sum of times here.
"""

from __future__ import annotations

from .errors import Refused

STREAM_BYTES = 1 << 30
META_BYTES = 1 << 20
SECTIONS = 64
STRING_BYTES = 1 << 16
NAME_BYTES = 1 << 10
EXTRA_ENTRIES = 1 << 10
FRAMES = 100_000
SEGMENTS = 100_000
CAMERA_SIDE = 1 << 14
CAMERA_PIXELS = 1 << 25
GAUSSIANS = 1 << 26
ATTRIBUTES = 64
ATTRIBUTE_WIDTH = 256
PLANE_CHANNELS = 1 << 12
SIDE = 1 << 16
SCALES = 16
NETWORKS = 32
NODES = 256
LAYER_SIZE = 1 << 17
WEIGHTS = 1 << 21

_MEMORY_AT_FIRST = 16 << 20
_LEAST_MEMORY = 256 << 20


class Budget:
    """Memory that decoding may still take, in bytes."""

    def __init__(self, stream_bytes: int) -> None:
        self._left = max(_LEAST_MEMORY, 4 * stream_bytes) - _MEMORY_AT_FIRST

    def take(self, part: str, field: str, count: int, bytes_each: int) -> None:
        """Takes memory, or refuses before it is taken if it does not fit any more."""
        self._left -= count * bytes_each
        if self._left < 0:
            raise Refused(part, field, "no more numbers than the memory of the limits is enough for")
