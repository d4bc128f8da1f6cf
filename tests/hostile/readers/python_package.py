#!/usr/bin/env python3
"""Takes through the package `light4gs` for Python: hostile-streams --what records | python_package.py [--seconds N]"""

import sys
import zlib

import light4gs
import numpy as np
from records import Reader, run


def shown(take: light4gs.Take, seconds: float) -> int:
    found = take.gaussians(seconds, convention="inria")
    count = len(found.means)
    # From red, green, blue behind each other to side by side.
    rest = np.ascontiguousarray(found.f_rest.reshape(count, 3, found.f_rest.shape[1] // 3).transpose(0, 2, 1))
    total = 0
    for array in (found.means, found.scale, found.rot, found.opacity, found.f_dc, rest):
        total = zlib.crc32(array.tobytes(), total)
    return total


def opened(data: bytes) -> light4gs.Take:
    take = light4gs.from_bytes(data)
    # What is no take any more is refused for that.
    if not isinstance(take, light4gs.Take):
        raise light4gs.Error("not-take", "a scene")
    return take


# Decoding a stream may take 2 seconds; there are the base and up to 16 segments.
PACKAGE = Reader("Python's package", opened, shown, light4gs.Error, False, 17 * 2, True)

if __name__ == "__main__":
    sys.exit(run(PACKAGE))
