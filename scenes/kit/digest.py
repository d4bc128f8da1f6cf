"""One digest for a folder, and whether it is the one that `digests.toml` has."""

import hashlib
import tomllib
from pathlib import Path

import bpy

KNOWN = Path(__file__).resolve().parent.parent / "digests.toml"


def of(folder):
    """SHA-256 over the names and the SHA-256 of all files, as text. In a shell, in the folder:
    find * -type f | LC_ALL=C sort | xargs sha256sum | sha256sum
    """
    folder = Path(folder)
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    lines = [f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n" for name in names]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def compared(name, usual, digest):
    """A sentence about the digest of a scene that was just rendered. `usual`: with the size and the length that it has without options."""
    known = tomllib.loads(KNOWN.read_text())
    expected = known["scenes"].get(name, {})
    if not usual:
        return f"sha256 {digest}; scenes/digests.toml has digests without --size and --frames only"
    if "digest" not in expected:
        return f"sha256 {digest}; scenes/digests.toml has none of {name}"
    if digest == expected["digest"]:
        return f"sha256 {digest}, as in scenes/digests.toml"
    return (f"sha256 {digest}; scenes/digests.toml has another one, of Blender {known['blender']} on {known['processor']} "
            f"(this is Blender {bpy.app.version_string}). Another processor rounds differently; cameras, times and what is seen are the same")
