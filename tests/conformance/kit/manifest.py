"""The lists of files, and the expected answer of a decoder to each.

A block begins with `accepted NAME` or `refused NAME`. `from PATH` names a file, from the folder of the lists; `edit ...` lines make
another one of it (forging.py). A file that is accepted then has its lines: SCENE-OR-TIME ARRAY CHECKSUM. One that is refused
has `expects PART: FIELD`, where the decoder of this folder finds what is wrong; other decoders may find it elsewhere.
Lines that begin with # are comments.
"""

from __future__ import annotations

import pathlib
from dataclasses import dataclass, field

from .forging import Edit, forge

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "manifest"
LISTS = ("accepted.txt", "refused.txt")
TIMES = ("0", "0.25", "0.37", "0.5", "1")


@dataclass
class Case:
    """One file of the set."""

    name: str
    accepted: bool
    source: pathlib.Path = pathlib.Path()
    edits: list[Edit] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    expects: str = ""

    def data(self) -> bytes:
        return forge((FOLDER / self.source).read_bytes(), self.edits)


def read_cases() -> list[Case]:
    cases: list[Case] = []
    for name in LISTS:
        for line in (FOLDER / name).read_text().splitlines():
            word, _, rest = line.partition(" ")
            if not line.strip() or line.startswith("#"):
                continue
            if word in ("accepted", "refused"):
                cases.append(Case(rest, word == "accepted"))
            elif word == "from":
                cases[-1].source = pathlib.Path(rest)
            elif word == "edit":
                cases[-1].edits.append(Edit.parse(rest))
            elif word == "expects":
                cases[-1].expects = rest
            else:
                cases[-1].lines.append(line)
    names = [case.name for case in cases]
    if len(set(names)) != len(names):
        raise ValueError("two files of the set have the same name")
    return cases


def write_lines(lines_of: dict[str, list[str]]) -> None:
    """Writes the list of accepted files with new lines, by the names of the files. Comments stay.

    In this list, an empty line stands between two blocks.
    """
    path = FOLDER / LISTS[0]
    result: list[str] = []
    name = ""
    for line in [*path.read_text().splitlines(), ""]:
        word, _, rest = line.partition(" ")
        if word == "accepted":
            name = rest
        if not line and name:
            result += lines_of[name]
            name = ""
        if not line or line.startswith("#") or word in ("accepted", "from", "edit"):
            result.append(line)
    path.write_text("\n".join(result))
