#!/usr/bin/env python3
"""Takes through the decoder of tests/conformance, which is Python alone: hostile-streams --what records | python_decoder.py [--seconds N]

It has limits of counts and memory and none of time, so files that promise much are left out.
"""

import pathlib
import sys
import zlib

import numpy as np
from records import Reader, run

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "conformance"))

from l4gs.errors import Refused  # noqa: E402
from l4gs.sections.gaussians import FIRST_ATTRIBUTES  # noqa: E402
from l4gs.take import Take, decode_take  # noqa: E402


def shown(take: Take, seconds: float) -> int:
    found, total = take.at(seconds), 0
    for name in [*(name for name, _ in FIRST_ATTRIBUTES), "sh_rest"]:
        total = zlib.crc32(np.ascontiguousarray(found[name], "<f4").tobytes(), total)
    return total


if __name__ == "__main__":
    sys.exit(run(Reader("Python's decoder", decode_take, shown, Refused, True, 60.0, False)))
