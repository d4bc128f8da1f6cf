"""An empty scene, its light, and the settings of the renderer."""

import math

import bpy
from mathutils import Matrix

from .cameras import look_at


def empty_scene():
    """Removes everything, Blender's own cube and lamp included."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    if scene.world is None:
        scene.world = bpy.data.worlds.new("world")
    return scene


def use_cycles(width, height, samples, threads=1, transparent=True):
    """Path tracing on the CPU. `transparent`: pictures have no background where nothing is seen.

    Few samples and a denoiser, and few bounces: a picture takes seconds of a core.
    """
    scene = bpy.context.scene
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.film_transparent = transparent
    render.image_settings.file_format = "PNG"
    render.image_settings.color_mode = "RGBA" if transparent else "RGB"
    render.image_settings.color_depth = "8"
    render.use_persistent_data = True
    render.threads_mode = "FIXED"
    render.threads = threads
    # Noise and unsharp edges cost bytes of a trained scene, and show nothing.
    render.dither_intensity = 0.0
    render.filter_size = 1.5
    # Colors as they are painted: no film curve.
    scene.view_settings.view_transform = "Standard"
    scene.display_settings.display_device = "sRGB"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = True
    cycles.adaptive_threshold = 0.01
    cycles.adaptive_min_samples = min(16, samples)
    cycles.max_bounces = 4
    cycles.diffuse_bounces = 2
    cycles.glossy_bounces = 2
    cycles.transmission_bounces = 2
    cycles.transparent_max_bounces = 4
    cycles.volume_bounces = 0
    cycles.caustics_reflective = False
    cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4.0
    cycles.blur_glossy = 0.5
    cycles.use_denoising = True
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = "NONE"


def quick_bounces(quick_denoiser=True):
    """Ambient occlusion in place of all bounces but the first, and a quicker denoiser: half the time, for scenes without mirrors."""
    cycles = bpy.context.scene.cycles
    cycles.use_fast_gi = True
    cycles.fast_gi_method = "REPLACE"
    cycles.ao_bounces_render = 1
    if quick_denoiser:
        cycles.denoising_quality = "BALANCED"


def sun(name, degrees, strength, color=(1, 1, 1), softness=6):
    """Light from far away. `softness`: degrees of the sky that it fills, which blur its shadows."""
    light = bpy.data.lights.new(name, "SUN")
    light.energy, light.color, light.angle = strength, color, math.radians(softness)
    placed = bpy.data.objects.new(name, light)
    placed.rotation_euler = [math.radians(angle) for angle in degrees]
    bpy.context.scene.collection.objects.link(placed)


def lamp(name, position, target, size, watts, color=(1, 1, 1)):
    """A square of light that no camera sees."""
    light = bpy.data.lights.new(name, "AREA")
    light.energy, light.color, light.size, light.shape = watts, color, size, "SQUARE"
    placed = bpy.data.objects.new(name, light)
    placed.matrix_world = Matrix(look_at(position, target).tolist())
    placed.visible_camera = False
    bpy.context.scene.collection.objects.link(placed)


def sky(top=(0.75, 0.85, 1.0), bottom=(0.35, 0.3, 0.27), strength=0.6):
    """Light from all around, from one color at the ground to another one above."""
    world = bpy.context.scene.world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputWorld")
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Strength"].default_value = strength
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    separate = tree.nodes.new("ShaderNodeSeparateXYZ")
    height = tree.nodes.new("ShaderNodeMapRange")
    height.inputs["From Min"].default_value = -0.6
    height.inputs["From Max"].default_value = 0.8
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    first, second = (socket for socket in mix.inputs if socket.type == "RGBA")
    first.default_value, second.default_value = (*bottom, 1), (*top, 1)
    link = tree.links.new
    link(coordinates.outputs["Generated"], separate.inputs[0])
    link(separate.outputs["Z"], height.inputs["Value"])
    link(height.outputs["Result"], mix.inputs["Factor"])
    link(next(socket for socket in mix.outputs if socket.type == "RGBA"), background.inputs["Color"])
    link(background.outputs[0], output.inputs[0])
