"""`scenes/render`, once bpy is there: reads the options, and renders."""

import argparse
import importlib
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent


def names():
    """The scenes: each file beside this folder is one."""
    return sorted(path.stem for path in FOLDER.glob("*.py"))


def main():
    parser = argparse.ArgumentParser(
        prog="scenes/render",
        description="Renders a scene into a folder in D-NeRF's layout: 100 training, 20 test and 10 val pictures, "
                    "and masks of what moves. What was stopped goes on with the same command.",
    )
    parser.add_argument("name", choices=names(), help="the scene")
    parser.add_argument("--size", type=int, default=400, metavar="PIXELS", help="width and height of a picture (400)")
    parser.add_argument("--out", metavar="DIR", help="the folder (data/dnerf/NAME)")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="processors to use (1); the pictures stay the same")
    parser.add_argument("--only", metavar="SPLIT:N", help="one picture, such as train:12, to look at")
    options = parser.parse_args()
    if not 16 <= options.size <= 4096:
        parser.error(f"--size {options.size}: from 16 to 4096")
    if options.threads < 1:
        parser.error(f"--threads {options.threads}: 1 or more")
    # Only now: bpy takes a second to load, and `--help` has nothing of it.
    from . import dataset

    scene = importlib.import_module(options.name).Scene()
    try:
        folder = options.out or Path("data/dnerf") / options.name
        dataset.write(options.name, scene, folder, options.size, options.threads, options.only)
    except dataset.Refused as problem:
        sys.exit(f"scenes/render: {problem}")


if __name__ == "__main__":
    main()
