"""`scenes/render`, once bpy is there: reads the options, and renders."""

import argparse
import importlib
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent


def names():
    """The scenes: each file beside this folder is one."""
    return sorted(path.stem.replace("_", "-") for path in FOLDER.glob("*.py"))


def main():
    parser = argparse.ArgumentParser(
        prog="scenes/render",
        description="Renders a scene into a folder in D-NeRF's layout: 100 training, 20 test and 10 val pictures, "
                    "and masks of what moves. A capture (room-...) has the layout of Neu3D, HyperNeRF or NeRF-DS. "
                    "What was stopped goes on with the same command.",
    )
    parser.add_argument("name", choices=names(), help="the scene")
    parser.add_argument("--size", type=int, metavar="PIXELS",
                        help="width and height of a picture (400); of a capture the longer side (room-rig 336, room-walk 480, room-pair 320)")
    parser.add_argument("--frames", type=int, metavar="N", help="only the first N moments of a capture, 4 or more (room-walk 60, the others 30)")
    parser.add_argument("--out", metavar="DIR", help="the folder (data/LAYOUT/NAME, such as data/dnerf/flag)")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="processors to use (1); the pictures stay the same")
    parser.add_argument("--only", metavar="PICTURE", help="one picture, such as train:12, to look at; of captures cam03:12, 000012 or 000012_left")
    options = parser.parse_args()
    if options.size is not None and not 16 <= options.size <= 4096:
        parser.error(f"--size {options.size}: from 16 to 4096")
    if options.frames is not None and options.frames < 4:
        parser.error(f"--frames {options.frames}: 4 or more")
    if options.threads < 1:
        parser.error(f"--threads {options.threads}: 1 or more")
    # Only now: bpy takes a second to load, and `--help` has nothing of it.
    from . import layouts, pictures

    scene = importlib.import_module(options.name.replace("-", "_")).Scene()
    folder = Path(options.out or Path("data") / layouts.layout_of(scene) / options.name)
    try:
        layouts.write(options.name, scene, folder, options.size, options.frames, options.threads, options.only)
    except pictures.Refused as problem:
        sys.exit(f"scenes/render: {problem}")


if __name__ == "__main__":
    main()
