"""Small networks as lists of operations: "Networks" of docs/format.md."""
