"""The one error of this package."""

from __future__ import annotations


class Refused(Exception):
    """A stream breaks a rule of the document.

    It names the part of the stream, the field in it, and what the document expects there.
    """

    def __init__(self, part: str, field: str, expectation: str) -> None:
        super().__init__(f"{part}: {field}: expected {expectation}")
        self.part = part
        self.field = field
        self.expectation = expectation
