"""A decoder of `.l4gs` streams that was written from docs/format.md alone. It is slow and clear; all bits are those of the document."""
