"""Writes a scene as a data set in D-NeRF's layout: pictures, cameras, and masks of what moves."""

import json
import os
import struct
import sys
import time
from pathlib import Path

import bpy
from mathutils import Matrix
from PIL import Image

from . import cameras, digest, studio
from .paint import glow_only

SPLITS = {"train": 100, "test": 20, "val": 10}
# Masks of motion are for measuring, and training views are not measured.
MASKED = ("test", "val")


class Refused(Exception):
    """What the folder or the options have wrong, in words for the person who asked."""


def write(name, scene, folder, size, threads, only=None):
    """Renders all splits of a scene. Pictures that are there already are kept, so what was stopped goes on.

    `only`: instead of everything, the picture of this split and number, such as `train:12`.
    """
    folder = Path(folder)
    plan = {split: cameras.frames(split, count, scene.seed) for split, count in SPLITS.items()}
    for split in plan:
        (folder / split).mkdir(parents=True, exist_ok=True)
        described = json.dumps({"camera_angle_x": cameras.OPENING, "frames": plan[split]}, indent=1)
        (folder / f"transforms_{split}.json").write_text(described)
    studio.empty_scene()
    studio.use_cycles(size, scene.samples, threads)
    scene.build()
    camera = _camera()
    pictures = [(split, index, frame, folder / split / f"r_{index:03d}.png")
                for split, frames in plan.items() for index, frame in enumerate(frames)]
    if only is not None:
        pictures = [picture for picture in pictures if f"{picture[0]}:{picture[1]}" == only]
        if not pictures:
            raise Refused(f"--only {only}: there is no such picture; name one as train:12")
    missing = [picture for picture in pictures if not _is_there(picture[3], size)]
    begun = time.monotonic()
    for number, (split, index, frame, path) in enumerate(missing, 1):
        scene.move(frame["time"])
        # Another pattern of noise in each picture, and the same one each time.
        bpy.context.scene.cycles.seed = index * 7 + {"train": 0, "test": 100003, "val": 200003}[split]
        _take(camera, frame, path)
        _say(f"{path}: {number} of {len(missing)}, {(time.monotonic() - begun) / number:.1f} s each")
    if only is None:
        _write_masks(scene, folder, plan, camera, size)
        _say(f"{folder}: {digest.compared(name, size, digest.of(folder))}")


def _write_masks(scene, folder, plan, camera, size):
    """White where something that moves is seen, one bit a pixel."""
    todo = [(frame, folder / "mask" / split / f"r_{index:03d}.png")
            for split in MASKED for index, frame in enumerate(plan[split])]
    todo = [(frame, path) for frame, path in todo if not _is_there(path, size)]
    if not todo:
        return
    white, black = glow_only("moves", 1.0), glow_only("stands", 0.0)
    for placed in bpy.data.objects:
        if placed.type == "MESH":
            placed.data.materials.clear()
            placed.data.materials.append(black if placed["still"] else white)
    blender = bpy.context.scene
    blender.world = None
    blender.render.film_transparent = False
    blender.render.image_settings.color_mode = "BW"
    blender.view_settings.view_transform = "Raw"
    blender.cycles.max_bounces = 0
    blender.cycles.samples = 16
    blender.cycles.seed = 0
    blender.cycles.use_adaptive_sampling = False
    blender.cycles.use_denoising = False
    blender.cycles.use_fast_gi = False
    for frame, path in todo:
        path.parent.mkdir(parents=True, exist_ok=True)
        scene.move(frame["time"])
        _take(camera, frame, path, one_bit=True)
    _say(f"{folder / 'mask'}: {len(todo)} masks")


def _camera():
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit = "HORIZONTAL"
    lens.angle = cameras.OPENING
    lens.clip_start, lens.clip_end = 0.01, 200
    placed = bpy.data.objects.new("camera", lens)
    bpy.context.scene.collection.objects.link(placed)
    bpy.context.scene.camera = placed
    return placed


def _take(camera, frame, path, one_bit=False):
    """One picture. Blender's own file has the date and the time that it took: it is written anew, without them."""
    camera.matrix_world = Matrix(frame["transform_matrix"])
    raw, whole = path.with_suffix(".raw.png"), path.with_suffix(".part.png")
    bpy.context.scene.render.filepath = str(raw)
    bpy.ops.render.render(write_still=True)
    with Image.open(raw) as image:
        pixels = image.point(lambda gray: 255 if gray >= 128 else 0).convert("1") if one_bit else image.copy()
    pixels.info.clear()
    pixels.save(whole, optimize=True)
    os.replace(whole, path)
    raw.unlink()


def _is_there(path, size):
    """Whether the picture was rendered before, at this size."""
    if not path.exists():
        return False
    with open(path, "rb") as file:
        width, height = struct.unpack(">II", file.read(24)[16:])
    if (width, height) != (size, size):
        raise Refused(f"{path} has {width}×{height} pixels, and --size asks for {size}: name another folder with --out, or remove this one")
    return True


def _say(text):
    print(text, file=sys.stderr, flush=True)
