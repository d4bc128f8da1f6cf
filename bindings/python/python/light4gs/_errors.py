"""The exception of the decoder."""


class Error(ValueError):
    """A file that cannot be decoded, or one that is beyond the limits.

    ``kind`` says what is wrong in one word that stays the same, such as ``"checksum"`` or ``"over-limit"``. The message
    names the section and the field.
    """

    kind: str

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind

    def __reduce__(self) -> "tuple[type[Error], tuple[str, str]]":
        return (type(self), (self.kind, str(self)))
