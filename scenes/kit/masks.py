"""Masks of motion, one bit a pixel: white where something that moves is seen, or black there."""

import bpy

from . import pictures
from .paint import glow_only


def write(scene, camera, masks, size, moving=255):
    """Renders the masks that are missing. The scene is of no use for pictures afterwards. `moving`: the value of what moves."""
    missing = pictures.missing(masks, size)
    if not missing:
        return
    _show_motion(size)
    for mask in missing:
        scene.move(mask.time)
        pictures.take(camera, mask.matrix, mask.path,
                      lambda image: image.point(lambda gray: moving if gray >= 128 else 255 - moving).convert("1"))
    pictures.say(f"{missing[-1].path}: the last of {len(missing)} masks")


def _show_motion(size):
    """Paints what moves white and what stands black, without light."""
    white, black = glow_only("moves", 1.0), glow_only("stands", 0.0)
    for placed in bpy.data.objects:
        if placed.type == "MESH":
            placed.data.materials.clear()
            placed.data.materials.append(black if placed["still"] else white)
    blender = bpy.context.scene
    blender.world = None
    blender.render.resolution_x, blender.render.resolution_y = size
    blender.render.film_transparent = False
    blender.render.image_settings.color_mode = "BW"
    blender.view_settings.view_transform = "Raw"
    blender.cycles.max_bounces = 0
    blender.cycles.samples = 16
    blender.cycles.seed = 0
    blender.cycles.use_adaptive_sampling = False
    blender.cycles.use_denoising = False
    blender.cycles.use_fast_gi = False
