"""How integers and bits come out of bytes: "Entropy coders" of docs/format.md."""
