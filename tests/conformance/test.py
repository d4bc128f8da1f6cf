#!/usr/bin/env python3
"""Tests of the decoder in Python and of the parts of `check`: python3 tests/conformance/test.py"""

from __future__ import annotations

import contextlib
import io
import pathlib
import struct
import sys
import tempfile
import unittest

FOLDER = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER))

import numpy as np  # noqa: E402

from kit.forging import Edit, forge, split  # noqa: E402
from kit.manifest import FOLDER as MANIFEST  # noqa: E402
from kit.manifest import LISTS, TIMES, Case, read_cases  # noqa: E402
from kit.refusals import list_of_refusals  # noqa: E402
from l4gs.checksum import crc32c  # noqa: E402
from l4gs.entropy.gaussian_tables import LEVELS, distribution  # noqa: E402
from l4gs.entropy.range_coder import level, wrapped  # noqa: E402
from l4gs.errors import Refused  # noqa: E402
from l4gs.networks.arithmetic import exponential, logarithm, without_tiny  # noqa: E402
from l4gs.text import lines  # noqa: E402

GOLDEN = FOLDER.parent / "golden-streams"


class TheSet(unittest.TestCase):
    """All files of the set, in this process: `check` starts one for each file."""

    def test_what_is_accepted_has_the_same_bits(self) -> None:
        for case in (case for case in read_cases() if case.accepted):
            with self.subTest(case.name):
                self.assertEqual(lines(case.data(), TIMES), case.lines)

    def test_what_is_refused_is_refused_for_its_reason(self) -> None:
        for case in (case for case in read_cases() if not case.accepted):
            with self.subTest(case.name):
                with self.assertRaises(Refused) as caught:
                    lines(case.data(), TIMES)
                refused = caught.exception
                self.assertEqual(f"{refused.part}: {refused.field}: {refused.expectation}", case.expects)

    def test_the_list_of_refusals_is_that_of_the_rules(self) -> None:
        self.assertEqual((MANIFEST / LISTS[1]).read_text(), list_of_refusals(MANIFEST))

    def test_frames_are_those_of_the_golden_streams(self) -> None:
        all_lines = {case.name: case.lines for case in read_cases()}
        for row in (GOLDEN / "frames.txt").read_text().splitlines():
            name, time, checksum = row.split()
            self.assertIn(f"{time} all {checksum}", all_lines[name])
            if name != "float32":
                self.assertIn(f"{time} all {checksum}", all_lines[f"{name}.decoded"])

    def test_a_compressed_stream_is_its_decoded_one(self) -> None:
        cases = {case.name: case.lines for case in read_cases()}
        for name in (name for name in cases if f"{name}.decoded" in cases):
            self.assertEqual(cases[name], cases[f"{name}.decoded"])


class Forging(unittest.TestCase):
    data = (GOLDEN / "float32.l4gs").read_bytes()

    def test_an_edit_that_changes_nothing_gives_the_same_file(self) -> None:
        self.assertEqual(forge(self.data, [Edit.parse("motion@0-0=")]), self.data)

    def test_lengths_and_checksums_fit_after_an_edit(self) -> None:
        longer = forge(self.data, [Edit.parse("sh@74-0=0000")])
        self.assertEqual(len(split(longer)["sh"]), len(split(self.data)["sh"]) + 2)
        with self.assertRaisesRegex(Refused, "sh: end: expected no more bytes, where 2 are left"):
            lines(longer, ())

    def test_edits_that_make_no_sense(self) -> None:
        for text in ("motion", "motion@1=00", "motion@1-1=0", "motion@-1-1=00"):
            self.assertRaises(ValueError, Edit.parse, text)
        self.assertRaises(ValueError, forge, self.data, [Edit.parse("sh@74-1=00")])


class Check(unittest.TestCase):
    """`check` finds the fault of a decoder."""

    def found(self, case: Case, program: str) -> list[str]:
        loaded: dict = {"__name__": "check", "__file__": str(FOLDER / "check")}
        exec(compile((FOLDER / "check").read_text(), "check", "exec"), loaded)
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            path = pathlib.Path(folder) / "decoder.py"
            path.write_text(program)
            return loaded["differences"](case, path, [sys.executable, str(path)])

    def test_decoders_that_are_wrong(self) -> None:
        accepted = Case("a", True, lines=["scene means 00000000"])
        refused = Case("b", False, expects="sh: degree: at most 3, not 4")
        self.assertEqual(self.found(accepted, "print('scene means 00000000')"), [])
        self.assertEqual(self.found(refused, "import sys; sys.exit('no')"), [])
        self.assertIn("expected scene means", self.found(accepted, "print('scene means 00000001')")[0])
        self.assertIn("0 lines, expected 1", self.found(accepted, "")[0])
        self.assertIn("refused: no", self.found(accepted, "import sys; sys.exit('no')")[0])
        self.assertIn("accepted; sh: degree", self.found(refused, "")[0])
        self.assertIn("without a message", self.found(refused, "import sys; sys.exit(1)")[0])
        self.assertIn("ended with 101", self.found(refused, "import sys; sys.exit(101)")[0])


class Arithmetic(unittest.TestCase):
    def test_checksum(self) -> None:
        self.assertEqual(crc32c(b"1234", b"56789"), 0xE3069283)

    def test_exponential_and_logarithm(self) -> None:
        x = np.linspace(-30, 80, 1000).astype(np.float32)
        np.testing.assert_allclose(exponential(x), np.exp(x.astype(np.float64)), rtol=3e-7)
        y = np.exp(x)
        np.testing.assert_allclose(logarithm(y), np.log(y.astype(np.float64)), rtol=3e-7, atol=1e-7)
        with np.errstate(all="ignore"):
            ends = exponential(np.array([-41, 89, np.nan, np.inf, -np.inf], np.float32))
        np.testing.assert_array_equal(ends, np.array([0, np.inf, np.nan, np.inf, 0], np.float32))
        with np.errstate(all="ignore"):
            ends = logarithm(np.array([0, -1, np.inf, np.nan], np.float32))
        np.testing.assert_array_equal(ends, np.array([-np.inf, np.nan, np.inf, np.nan], np.float32))

    def test_tiny_numbers_are_zero_without_a_sign(self) -> None:
        found = without_tiny(np.array([-0.0, -(2.0**-51), 2.0**-50], np.float32))
        self.assertEqual(found.tobytes(), struct.pack("<3f", 0, 0, 2.0**-50))

    def test_every_slot_of_every_level_has_a_frequency(self) -> None:
        for i in range(LEVELS):
            begins = distribution(i).begins
            self.assertEqual(begins[0], 0)
            self.assertTrue(all(a < b for a, b in zip(begins, begins[1:])))

    def test_levels_of_magnitudes(self) -> None:
        self.assertEqual([level(v, 13) for v in (0, 1, 2, 3, 4, 6, 8, 12, 1 << 40)], [0, 1, 3, 4, 5, 6, 7, 8, 13])
        self.assertEqual([wrapped(v) for v in (1 << 31, -(1 << 31) - 1, 5)], [-(1 << 31), (1 << 31) - 1, 5])


if __name__ == "__main__":
    unittest.main()
