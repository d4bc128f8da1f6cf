"""Pictures of a scene. Those that are there already are kept, so what was stopped goes on."""

import os
import struct
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from PIL import Image

from . import studio


class Refused(Exception):
    """What the folder or the options have wrong, in words for the person who asked."""


@dataclass(frozen=True)
class Picture:
    """One that is wanted. `name`: for `--only`. `matrix`: camera to world. `seed`: of its noise."""

    name: str
    path: Path
    time: float
    matrix: np.ndarray
    seed: int


def set_up(scene, lens, threads, transparent=True):
    """Makes the scene, and a camera in it."""
    studio.empty_scene()
    studio.use_cycles(lens.width, lens.height, scene.samples, threads, transparent)
    scene.build()
    made = bpy.data.cameras.new("camera")
    made.sensor_fit = "HORIZONTAL"
    made.angle = lens.opening
    made.clip_start, made.clip_end = 0.01, 200
    camera = bpy.data.objects.new("camera", made)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    return camera


def chosen(pictures, only):
    """All of them, or the one of this name."""
    if only is None:
        return pictures
    named = [picture for picture in pictures if picture.name == only]
    if not named:
        raise Refused(f"--only {only}: there is no such picture; name one as {pictures[-1].name}")
    return named


def missing(pictures, size):
    """Those that are not there yet."""
    return [picture for picture in pictures if not is_there(picture.path, size)]


def render(scene, camera, pictures, size, shrink=1):
    """Renders those that are missing. `size`: width and height of a picture, which is rendered `shrink` times as large."""
    todo = missing(pictures, size)
    begun, now = time.monotonic(), None
    for number, picture in enumerate(todo, 1):
        if picture.time != now:
            scene.move(picture.time)
            now = picture.time
        bpy.context.scene.cycles.seed = picture.seed
        take(camera, picture.matrix, picture.path, lambda image: _shrunk(image, shrink))
        say(f"{picture.path}: {number} of {len(todo)}, {(time.monotonic() - begun) / number:.1f} s each")


def take(camera, matrix, path, changed):
    """One picture, as `changed` makes it. Blender's own file has the date and the time that it took: it is written anew, without them."""
    camera.matrix_world = Matrix(np.asarray(matrix, float).tolist())
    raw, whole = path.with_suffix(".raw.png"), path.with_suffix(".part.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.context.scene.render.filepath = str(raw)
    bpy.ops.render.render(write_still=True)
    with Image.open(raw) as image:
        pixels = changed(image)
    pixels.info.clear()
    pixels.save(whole, optimize=True)
    os.replace(whole, path)
    raw.unlink()


def is_there(path, size):
    """Whether the picture was rendered before, at this size."""
    if not path.exists():
        return False
    with open(path, "rb") as file:
        found = struct.unpack(">II", file.read(24)[16:])
    refuse_other_size(path, found, size)
    return True


def refuse_other_size(path, found, size):
    """Refuses a picture or video that was made with another `--size`."""
    if tuple(found) != tuple(size):
        raise Refused(f"{path} has {found[0]}×{found[1]} pixels, and --size asks for {size[0]}×{size[1]}: "
                      "name another folder with --out, or remove this one")


def say(text):
    """Tells how far it is."""
    print(text, file=sys.stderr, flush=True)


def _shrunk(image, times):
    """Each pixel is the mean of `times` × `times` ones."""
    if times == 1:
        return image.copy()
    pixels = np.asarray(image, float)
    height, width, channels = pixels.shape
    means = pixels.reshape(height // times, times, width // times, times, channels).mean((1, 3))
    return Image.fromarray(np.round(means).astype(np.uint8))
