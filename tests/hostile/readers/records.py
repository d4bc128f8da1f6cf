"""Takes from `hostile-streams --what records`, and the comparison of a reader's answers with those of the codec.

A record is a line of JSON, and then the bytes of a file; tests/hostile/streams/src/takes/record.rs writes them. What the codec says
of a take that was damaged by itself has been compared with the sound take there. So a reader is right where it says the same.
"""

from __future__ import annotations

import argparse
import json
import resource
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, BinaryIO, NamedTuple

#: An open take has its base and three segments, each within the 256 MiB of one stream; and there is the interpreter.
MOST_MIB = 4 * 256 + 128


class Reader(NamedTuple):
    """A reader of takes."""

    name: str
    #: A take from its bytes.
    open: Callable[[bytes], Any]
    #: The checksum of the Gaussians of a take at a time in seconds.
    shown: Callable[[Any, float], int]
    #: What both raise for a take that is refused.
    refusal: type[Exception]
    #: It decodes all segments at once, and so refuses the whole take where one of them is damaged.
    whole: bool
    #: Most seconds of the processor for one take, and whether more is a fault or just too slow.
    most_seconds: float
    must_end: bool


class TooSlow(BaseException):
    """One take takes too long."""


def _records(stream: BinaryIO) -> Iterator[tuple[dict, bytes]]:
    while line := stream.readline():
        record = json.loads(line)
        yield record, stream.read(record["bytes"])


def _fault(reader: Reader, record: dict, data: bytes) -> tuple[str | None, bool]:
    """What is wrong with the answers, and whether something was shown."""
    asked = [entry for entry in record["asked"] if entry[1] != "large"]
    refused_of_whole = [entry for entry in record["asked"] if entry[1] == "refused"]
    over_limit = any(entry[2] == "over-limit" for entry in refused_of_whole)
    try:
        take = reader.open(data)
    except reader.refusal as refusal:
        # More segments than are asked for may be damaged.
        expected = refused_of_whole if reader.whole else len(refused_of_whole) == len(record["asked"])
        unknown = reader.whole and record["forged"]
        return (None if expected or unknown else f"refuses what the codec opens: {refusal}"), False
    shown = False
    for entry in asked:
        try:
            found = reader.shown(take, entry[0])
        except reader.refusal as refusal:
            if entry[1] != "refused":
                return f"refuses {entry[0]} s, which the codec shows: {refusal}", shown
            continue
        shown = True
        # Limits of memory and time are each reader's own.
        if entry[1] == "refused" and not (reader.whole and over_limit):
            return f"shows {entry[0]} s, which the codec refuses as {entry[2]}", shown
        if entry[1] == "shown" and found != entry[2]:
            return f"shows other Gaussians at {entry[0]} s", shown
    return None, shown


def run(reader: Reader) -> int:
    """Reads records from the standard input and prints what was found."""
    parser = argparse.ArgumentParser(description=f"hostile-streams --what records | ... : takes through {reader.name}")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="seconds of the processor, then it ends")
    arguments = parser.parse_args()

    def too_slow(*_: object) -> None:
        raise TooSlow

    signal.signal(signal.SIGVTALRM, too_slow)
    begin, most, counts, findings = time.process_time(), (0.0, -1), Counter(), []
    for record, data in _records(sys.stdin.buffer):
        if reader.whole and record["bomb"]:
            counts["left out: they promise much"] += 1
            continue
        before = time.process_time()
        signal.setitimer(signal.ITIMER_VIRTUAL, reader.most_seconds)
        try:
            fault, shown = _fault(reader, record, data)
        except TooSlow:
            fault, shown = ("takes too long" if reader.must_end else None), False
            counts["given up: too slow"] += 1
        except BaseException as error:  # A panic of Rust is no Exception.
            if isinstance(error, KeyboardInterrupt):
                raise
            fault, shown = f"fails: {type(error).__name__}: {error}", False
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        counts["takes"] += 1
        counts["takes that show something"] += shown
        counts["forged" if record["forged"] else "damaged"] += 1
        most = max(most, (time.process_time() - before, record["number"]))
        if fault:
            findings.append(f"take {record['number']} ({record['kind']}): {fault}")
            print(findings[-1], flush=True)
        if time.process_time() - begin > arguments.seconds:
            break
    mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    if mib > MOST_MIB:
        findings.append(f"the process took {mib} MiB, expected at most {MOST_MIB}")
        print(findings[-1])
    print(
        f"{reader.name}: {dict(counts)}, {len(findings)} findings; {time.process_time() - begin:.0f} s, "
        f"at most {most[0]:.3f} s (take {most[1]}), process at most {mib} MiB"
    )
    return 1 if findings or not counts["takes"] else 0
