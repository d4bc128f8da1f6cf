"""The room of the captures: a floor of planks, papered walls, and things that stand. Its front is open, toward -y."""

import bpy
import numpy as np

from .meshes import Mesh
from .paint import Paint, clouded, color
from .shapes import box, lathe, rectangle, sphere
from .studio import lamp, quick_bounces, sky

# The surfaces around everything else, by the names of their meshes.
WALLS = ("floor", "back wall", "left wall", "right wall")
HALF, BACK, FRONT = 2.3, 1.7, -3.2        # of the room: half of its width, and its ends in y
BOOKS = ("#e63946", "#457b9d", "#2a9d8f", "#f4a261", "#6a4c93", "#f1faee", "#ffca3a", "#1d3557")


def floor_paint():
    """Planks, each with a tone of its own."""
    paint = Paint("floor")
    x, y, _ = paint.at().parts()
    plank = (x + 20.0) * (1 / 0.22)
    number, across = plank.floor(), plank.fraction()
    shifted = y + number * 0.377
    piece = (shifted + 20.0) * (1 / 1.1)
    gap = across.below(0.025, 0.012).larger(across.above(0.975, 0.012)).larger(piece.fraction().below(0.006, 0.003))
    grain = paint.noise(paint.vector(x * 16.0, shifted * 1.6, number * 2.9), 1.0, 3, 0.5, 0.8)
    tone = paint.noise(paint.vector(number * 1.7, piece.floor(), 0.0), 2.0, 0)
    shade = grain.ramp([(0.3, color("#5e3c22")), (0.5, color("#96683c")), (0.7, color("#c49a67"))])
    shade = paint.mix(tone * 0.5, shade, color("#7d4b2a"))
    shade = paint.mix(gap, shade, color("#1d120a"))
    return paint.surface(shade, roughness=0.38, normal=paint.bump(grain - gap, 0.12, 0.01))


def wall_paint(name, dark, light, flower):
    """Paper with flowers in rows, above a white skirting board."""
    paint = Paint(name)
    at = paint.at()
    along, up, _ = at.parts()
    row = up * (1 / 0.34)
    right, above = (along * (1 / 0.34) + row.floor() * 0.5).fraction() - 0.5, row.fraction() - 0.5
    distance = (right * right + above * above).root()
    petals = distance + (above.angle(right) * 6.0).cosine() * -0.06
    shade = paint.noise(at, 2.2, 2).ramp([(0.3, color(dark)), (0.7, color(light))])
    shade = paint.mix(petals.below(0.22, 0.015), shade, color(flower))
    shade = paint.mix(distance.below(0.07, 0.01), shade, color("#f2c14e"))
    shade = paint.mix(up.below(0.16), shade, color("#efe9dd"))
    shade = paint.mix(up.between(0.16, 0.175), shade, color("#6b4a2f"))
    return paint.surface(shade, roughness=0.75)


def picture_paint():
    """A painting: fields of five colors with black outlines."""
    paint = Paint("picture")
    at = paint.at()
    haze = paint.noise(at, 1.6, 5, 0.55, 1.6)
    warped = at + paint.noise(at, 2.0, 2, three=True) * 0.5
    field, _, _ = paint.cell_colors(warped, 2.4).parts()
    shade = field.ramp([(0, color("#264653")), (.2, color("#2a9d8f")), (.4, color("#e9c46a")), (.6, color("#f4a261")), (.8, color("#e76f51"))], steps=True)
    shade = paint.mix(paint.cells(warped, 2.4, edges=True).below(0.03, 0.01), shade, color("#111111"))
    shade = paint.mix(haze * 0.3, shade, color("#ffffff"))
    return paint.surface(shade, roughness=0.4)


def rug_paint():
    """Rings of red, cream and blue with a wavy edge."""
    paint = Paint("rug")
    at = paint.at()
    x, y, _ = at.parts()
    reach = (x * x + y * y).root() + (y.angle(x) * 16.0).cosine() * 0.02
    shade = reach.ramp([(0, color("#8d0801")), (.18, color("#f4d58d")), (.24, color("#001427")), (.46, color("#bf0603")), (.56, color("#708d81")),
                        (.78, color("#f4d58d")), (.86, color("#001427"))], steps=True)
    shade = paint.mix(paint.noise(at, 25, 2) * 0.25, shade, color("#2b1d14"))
    return paint.surface(shade, roughness=0.95, sheen=0.3)


def thing(name, shape, at, paint, smooth=True, rest=None):
    """Something that stands. Its paint goes by its own coordinates, or by `rest`."""
    vertices, faces = shape
    Mesh(name, vertices + np.array(at, float), faces, paint, rest=vertices if rest is None else rest, smooth=smooth, still=True)


def matter(name, dark, light, scale, roughness=0.5, metal=0.0, coat=0.0):
    """What the things of the room are made of."""
    return clouded(name, dark, light, scale, roughness, metal, coat, distortion=0.4)


def build(floor, height=3.0, rug=True, table=(1.35, 0.75)):
    """Makes the room and its light. `floor`: its z. `table`: where it stands."""
    _walls(floor, height)
    _picture(floor)
    if rug:
        vertices, faces = lathe([(0, floor + .002), (.95, floor + .002), (.96, floor + .012), (.94, floor + .02), (0, floor + .02)], 96)
        Mesh("rug", vertices, faces, rug_paint(), smooth=False, still=True)
    _shelf(floor)
    _table(floor, *table)
    lamp("ceiling", (0.3, -0.6, floor + 3.4), (0, 0.2, floor), 2.6, 190, (1.0, 0.93, 0.82))
    lamp("window", (-2.9, -3.0, floor + 2.2), (0, 0.3, floor + 1), 1.8, 140, (0.75, 0.86, 1.0))
    sky((0.8, 0.85, 0.95), (0.5, 0.45, 0.4), 0.8)
    # Two lamps need no tree to choose one from.
    bpy.context.scene.cycles.use_light_tree = False
    quick_bounces(quick_denoiser=False)


def _walls(floor, height):
    vertices, faces, _ = rectangle((-HALF - 1.5, FRONT, floor), (2 * HALF + 3.0, 0, 0), (0, BACK - FRONT, 0), 30, 30)
    Mesh("floor", vertices, faces, floor_paint(), rest=vertices - (0, 0, floor), still=True)
    upward, backward = (0, 0, height), (0, BACK - FRONT, 0)
    for name, corner, side, colors in (
        ("back wall", (-HALF, BACK, floor), (2 * HALF, 0, 0), ("#7fa39a", "#a5c4b6", "#4c7a70")),
        ("left wall", (-HALF, FRONT, floor), backward, ("#c9a27a", "#e2c7a0", "#a8643c")),
        ("right wall", (HALF, FRONT, floor), backward, ("#8a93b8", "#b6bddb", "#53608f")),
    ):
        vertices, faces, lengths = rectangle(corner, side, upward, 30, 20)
        Mesh(name, vertices, faces, wall_paint(name, *colors), rest=lengths, still=True)


def _picture(floor):
    x, z, width, height = -0.15, floor + 1.95, 1.35, 0.85
    thing("frame", box(width + .14, .05, height + .14, .02, 2), (x, BACK - .025, z), matter("frame", "#5a3b14", "#b98d3e", 14, .3, .6), smooth=False)
    vertices, faces, lengths = rectangle((x - width / 2, BACK - .055, z - height / 2), (width, 0, 0), (0, 0, height), 8, 8)
    Mesh("picture", vertices, faces, picture_paint(), rest=lengths, still=True)


def _shelf(floor):
    """Two rows of books, and a vase and a ball above them."""
    x, y = -1.65, BACK - .20
    for number, height in enumerate((.05, .60, 1.15)):
        thing(f"board {number}", box(1.0, .34, .05, .008, 2), (x, y, floor + height), matter(f"board {number}", "#8a5a2b", "#c69056", 7), smooth=False)
    for side in (-.5, .5):
        thing(f"side {side}", box(.05, .34, 1.2, .008, 2), (x + side, y, floor + .60), matter(f"side {side}", "#8a5a2b", "#c69056", 7), smooth=False)
    random = np.random.default_rng(7)
    for height in (.075, .625):
        left = x - .45
        while left < x + .36:
            thick, tall = random.uniform(.045, .09), random.uniform(.28, .42)
            shape = box(thick, .24, tall, .006, 1)
            dark, light = (BOOKS[random.integers(len(BOOKS))] for _ in range(2))
            # Each has clouds of its own.
            thing("book", shape, (left + thick / 2, y - .02, floor + height + tall / 2), matter("book", dark, light, 5), smooth=False, rest=shape[0] + left)
            left += thick + .006
    vase = lathe([(0, 0), (.10, 0), (.16, .10), (.13, .24), (.06, .30), (.085, .36), (.07, .36), (0, .30)], 48)
    thing("vase", vase, (x + .18, y, floor + 1.175), matter("vase", "#0b3d91", "#f0f4ff", 9, .15, 0, .6))
    unit, faces = sphere(48, 24)
    thing("shelf ball", (unit * .14, faces), (x - .22, y, floor + 1.315), matter("shelf ball", "#f77f00", "#fcbf49", 4, .3, 0, .4), rest=unit)


def _table(floor, x, y):
    """A round table with a pot and a cactus."""
    thing("table top", lathe([(0, .78), (.42, .78), (.44, .80), (.42, .83), (0, .83)], 64), (x, y, floor),
          matter("table top", "#3f2a1a", "#7d5634", 5, .3), smooth=False)
    thing("table leg", lathe([(0, 0), (.25, 0), (.24, .03), (.06, .07), (.045, .4), (.06, .70), (.18, .78), (0, .78)], 48), (x, y, floor),
          matter("table leg", "#3f2a1a", "#7d5634", 5, .35))
    pot = lathe([(0, 0), (.10, 0), (.15, .06), (.155, .12), (.11, .19), (.05, .21), (.03, .24), (0, .25)], 48)
    thing("pot", pot, (x - .12, y - .08, floor + .83), matter("pot", "#b23a48", "#fcb9b2", 7, .2, 0, .5))
    unit, faces = sphere(72, 40)
    ribs = .11 * (1 + .10 * np.cos(12 * np.arctan2(unit[:, 1], unit[:, 0])))
    thing("cactus", (unit * np.c_[ribs, ribs, np.full(len(unit), .19)], faces), (x + .17, y + .10, floor + 1.08),
          matter("cactus", "#1b4332", "#74c69d", 12, .6), rest=unit)
    thing("cactus pot", lathe([(0, 0), (.09, 0), (.12, .11), (.125, .14), (0, .13)], 40), (x + .17, y + .10, floor + .83),
          matter("cactus pot", "#bc6c25", "#dda15e", 8), smooth=False)
