"""A flag in the wind, two gears that mesh, and a knot that turns on a pedestal."""

import math

import numpy as np

from kit.meshes import Mesh
from kit.motion import TURN, rotation, smooth
from kit.paint import Paint, clouded, color
from kit.shapes import box, grid_faces, lathe, tube
from kit.studio import lamp, sky, sun

BASE = -0.92
POLE = np.array([-0.72, 0.12, 0.0])
WIDTH, HEIGHT, LOWER_EDGE = 1.22, 0.74, 0.22
COLUMNS, ROWS = 90, 44
# Teeth and radius: radii are as the numbers of teeth, so that the gears mesh.
LARGE_TEETH, LARGE_RADIUS, LARGE_CENTER = 14, 0.34, np.array([-0.30, -0.42, -0.42])
SMALL_TEETH, SMALL_RADIUS = 9, 0.2186
CONTACT = math.radians(28)        # direction from the large gear to the small one
SMALL_CENTER = LARGE_CENTER + (LARGE_RADIUS + SMALL_RADIUS) * np.array([math.cos(CONTACT), 0, math.sin(CONTACT)])
KNOT = np.array([0.47, 0.33, -0.30])
KNOT_POINTS, KNOT_AROUND = 260, 24


def cloth(time):
    """Vertices of the flag: its direction runs in waves from the pole to the end, and is summed up along the cloth."""
    wave = TURN * 2.0 * time
    gust = 1.0 + 0.35 * math.sin(TURN * time + 0.7)
    along, up = np.meshgrid(np.linspace(0, WIDTH, COLUMNS + 1), np.linspace(0, 1, ROWS + 1), indexing="ij")
    step = along[1, 0] - along[0, 0]
    share = along / WIDTH
    swing = 0.95 * gust * smooth(share / 0.45) * (0.75 + 0.25 * share)
    angle = (swing * np.sin(TURN * 1.35 * share - wave + 1.1 * (up - 0.5))
             + 0.28 * share * np.sin(TURN * 3.1 * share - 2 * wave + 2.3 * up))
    angle = angle + 0.25 * math.sin(TURN * time)
    x, y = np.zeros_like(along), np.zeros_like(along)
    x[1:] = np.cumsum((np.cos(angle)[1:] + np.cos(angle)[:-1]) / 2, 0) * step
    y[1:] = np.cumsum((np.sin(angle)[1:] + np.sin(angle)[:-1]) / 2, 0) * step
    droop = (-0.07 * share ** 2 * (1.2 - 0.4 * math.sin(TURN * time + 0.7))
             - 0.05 * share * (1 - up) * math.sin(wave * 0.5))
    vertices = np.stack([x + 0.022, y, LOWER_EDGE + HEIGHT * up + droop], -1)
    vertices[..., :2] += POLE[:2]
    return vertices.reshape(-1, 3)


def cloth_rest():
    """Coordinates on the cloth: along it and up."""
    along, up = np.meshgrid(np.linspace(0, WIDTH, COLUMNS + 1), np.linspace(0, 1, ROWS + 1), indexing="ij")
    return np.stack([along / WIDTH * WIDTH, up * HEIGHT, 0 * up], -1).reshape(-1, 3)


def cloth_paint():
    """Three stripes, a sun, checks at the pole and dots at the end."""
    paint = Paint("flag")
    at = paint.at()
    x, y, _ = at.parts()
    shade = (y * (1 / HEIGHT)).ramp([(0.0, color("#0b3954")), (0.333, color("#f4f1de")), (0.666, color("#c81d25"))], steps=True)
    right, above = x - 0.60, y - HEIGHT / 2
    distance = (right * right + above * above).root()
    rays = distance + (above.angle(right) * 12.0).cosine() * -0.035
    shade = paint.mix(rays.below(0.205, 0.004), shade, color("#f5b700"))
    shade = paint.mix(distance.below(0.135, 0.003), shade, color("#7a1e0a"))
    shade = paint.mix(distance.below(0.120, 0.003), shade, color("#ffdd55"))
    triangle = x * 1.35 + abs(above)
    checks = paint.checks(at + (0.001, 0.001, 0.5), 16, color("#13315c"), color("#8da9c4"))
    shade = paint.mix(triangle.below(HEIGHT / 2, 0.003), shade, checks)
    dots = paint.cells(at + (3.0, 3.0, 0), 9.0, randomness=0.0).below(0.28, 0.03) * x.above(0.88, 0.002)
    shade = paint.mix(dots, shade, color("#2ec4b6"))
    weave = paint.noise(at * (90, 30, 1), 1.0, 2)
    shade = paint.mix(weave * 0.22, shade, color("#30261f"))
    return paint.surface(shade, roughness=0.65, sheen=0.3)


def gear(teeth, radius, depth=0.09):
    """A gear about the axis y: a rim with teeth, a recess, and a hub with a hole."""
    outer, inner, hole = radius * (1 + 1.05 / teeth), radius * (1 - 1.30 / teeth), radius * 0.20
    profile = []
    for tooth in range(teeth):
        start, pitch = TURN * tooth / teeth, TURN / teeth
        for share, reach in ((-0.28, inner), (-0.12, outer), (0.12, outer), (0.28, inner), (0.5, inner)):
            profile.append((reach, start + share * pitch))
    count = len(profile)
    # From the teeth inward, on either side: radius (none: the profile's own) and height as a share.
    rings = [(None, 1.0), (inner * 0.82, 1.0), (inner * 0.78, 0.45), (radius * 0.36, 0.45), (radius * 0.33, 1.15), (hole, 1.15)]
    vertices = [((at or reach) * math.cos(turn), y * height, (at or reach) * math.sin(turn))
                for y in (depth / 2, -depth / 2) for at, height in rings for reach, turn in profile]
    faces = []
    back = len(rings) * count
    for step in range(count):
        beside = (step + 1) % count
        for ring in range(len(rings) - 1):
            here, inside = ring * count, (ring + 1) * count
            faces.append((here + beside, here + step, inside + step, inside + beside))
            faces.append((back + here + step, back + here + beside, back + inside + beside, back + inside + step))
        faces.append((step, beside, back + beside, back + step))
        last = (len(rings) - 1) * count
        faces.append((last + beside, last + step, back + last + step, back + last + beside))
    return np.array(vertices), faces


def gear_paint(name, dark, light, mark, metal):
    """Turned metal with rust; a mark in one direction shows that the gear turns."""
    paint = Paint(name)
    at = paint.at()
    x, y, z = at.parts()
    distance = (x * x + z * z).root()
    turn = z.angle(x)
    rings = paint.noise(paint.vector(distance * 60.0, turn * 1.5, y), 1.0, 4)
    rust = paint.noise(at, 8, 6, 0.65, 0.5)
    rusty = rust.above(0.56, 0.04)
    shade = rings.ramp([(0.35, color(dark)), (0.65, color(light))])
    shade = paint.mix(rusty, shade, color("#8a4b22"))
    shade = paint.mix(turn.cosine().above(0.80, 0.01) * distance.between(0.10, 0.16, 0.003), shade, color(mark))
    fifths = (turn * 5.0).cosine().above(0.3, 0.05)
    shade = paint.mix(fifths * distance.between(0.17, 0.215, 0.003), shade, color("#f3e9d2"))
    return paint.surface(shade, roughness=rust * 0.35 + 0.2, metal=(1.0 - rusty) * metal, normal=paint.bump(rings, 0.15, 0.005))


def knot_paint():
    """Four colors that wind around the tube."""
    paint = Paint("knot")
    along, around, _ = paint.at().parts()
    cloud = paint.noise(paint.at("place"), 6.5, 6, 0.6, 0.8)
    winding = (along * 24.0 + around * 2.0).fraction()
    shade = winding.ramp([(0.0, color("#5f0f40")), (0.25, color("#9a031e")), (0.5, color("#fb8b24")), (0.75, color("#0f4c5c"))], steps=True)
    shade = paint.mix(cloud.above(0.52, 0.03) * 0.8, shade, color("#fff3d6"))
    return paint.surface(shade, roughness=0.2, coat=0.5, normal=paint.bump(cloud, 0.2, 0.01))


def ground_paint():
    """Bricks, with grass around them and earth below."""
    paint = Paint("ground")
    at = paint.at()
    x, y, z = at.parts()
    distance = (x * x + y * y).root()
    bricks = paint.bricks(at + (5.0, 5.0, 0), 4.2, color("#a44a3f"), color("#d4a373"), color("#e9e2d0"))
    cloud = paint.noise(at, 10, 5)
    shade = paint.mix(cloud * 0.45, bricks, color("#4a2f27"))
    grass = paint.noise(at, 26, 5, 0.7).ramp([(0.3, color("#2f5d23")), (0.7, color("#8fbf4d"))])
    shade = paint.mix((distance + cloud * 0.12).above(0.93, 0.01), shade, grass)
    earth = cloud.ramp([(.3, color("#3d2b1f")), (.7, color("#7a5a3a"))])
    shade = paint.mix(z.below(BASE - 0.012, 0.003), shade, earth)
    return paint.surface(shade, roughness=0.6, normal=paint.bump(cloud, 0.3, 0.01))


def knot_path():
    """A torus knot."""
    turn = np.linspace(0, TURN, KNOT_POINTS, endpoint=False)
    reach = 0.20 + 0.085 * np.cos(3 * turn)
    return np.stack([reach * np.cos(2 * turn), reach * np.sin(2 * turn), 0.105 * np.sin(3 * turn)], 1)


class Scene:
    """See above."""

    seed = 4
    samples = 18

    def build(self):
        """Makes everything, at time 0."""
        sky((0.7, 0.83, 1.0), (0.36, 0.33, 0.26), 0.8)
        sun("key", (40, 15, 60), 2.6, (1.0, 0.95, 0.86), 6)
        lamp("fill", (-1.5, -3.2, 1.6), (0, 0, 0), 2.0, 70, (0.9, 0.93, 1.0))
        self.place()

    def place(self):
        """Makes everything but the light."""
        vertices, faces = lathe([(0, BASE - .09), (0.90, BASE - .09), (0.985, BASE - .06), (1.0, BASE - .012), (0.985, BASE), (0, BASE)], 128)
        Mesh("ground", vertices, faces, ground_paint(), smooth=False, still=True)
        vertices, faces = lathe([(0, BASE), (.085, BASE), (.08, BASE + .05), (.03, BASE + .07), (.022, BASE + .1), (.020, 1.0),
                                 (.045, 1.01), (.05, 1.04), (.03, 1.075), (0, 1.085)], 40)
        Mesh("pole", vertices + POLE, faces, clouded("pole", "#8f8f94", "#d9d9de", 12, 0.25, 1.0), rest=vertices, still=True)
        self.flag = Mesh("flag", cloth(0), grid_faces(COLUMNS + 1, ROWS + 1), cloth_paint(), rest=cloth_rest())
        self.large, faces = gear(LARGE_TEETH, LARGE_RADIUS)
        self.large_gear = Mesh("large gear", self.large, faces, gear_paint("large gear", "#8c9299", "#d0d5da", "#e4002b", 0.9), smooth=False)
        self.small, faces = gear(SMALL_TEETH, SMALL_RADIUS)
        self.small_gear = Mesh("small gear", self.small, faces, gear_paint("small gear", "#a67c1a", "#e8c24a", "#0057b7", 0.9), smooth=False)
        for center, name in ((LARGE_CENTER, "large"), (SMALL_CENTER, "small")):
            height = center[2] - BASE + 0.05
            vertices, faces = box(0.10, 0.05, height, 0.012, 2)
            vertices = vertices + np.array([center[0], center[1] + 0.10, BASE + height / 2])
            Mesh(f"{name} stand", vertices, faces, clouded(f"{name} stand", "#5b3a21", "#9c6b3f", 9, 0.5), smooth=False, still=True)
            vertices, faces = lathe([(0, -.075), (.028, -.075), (.028, .1), (0, .1)], 32)
            vertices = vertices @ rotation((1, 0, 0), -math.pi / 2).T
            Mesh(f"{name} axle", vertices + center, faces, clouded(f"{name} axle", "#303035", "#5a5a60", 9, 0.3, 1.0), rest=vertices, smooth=False, still=True)
        vertices, faces = lathe([(0, 0), (.20, 0), (.20, .05), (.15, .08), (.12, .12), (.115, .24), (.16, .28), (.16, .31), (0, .31)], 64)
        marble = clouded("marble", "#9aa0a8", "#f4f4f2", 6, 0.25)
        Mesh("pedestal", vertices + np.array([KNOT[0], KNOT[1], BASE]), faces, marble, rest=vertices, smooth=False, still=True)
        self.knot, faces = tube(knot_path(), 0.058, KNOT_AROUND, closed=True)
        along, around = np.meshgrid(np.arange(KNOT_POINTS) / KNOT_POINTS, np.arange(KNOT_AROUND) / KNOT_AROUND, indexing="ij")
        # There and back again, so that the paint has no seam.
        rest = np.stack([1 - np.abs(2 * along - 1), 1 - np.abs(2 * around - 1), 0 * along], -1).reshape(-1, 3)
        self.turning_knot = Mesh("knot", self.knot, faces, knot_paint(), rest=rest)
        self.turning_knot.attribute("place", self.knot)

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        self.flag.move(cloth(time))
        turned = TURN * 0.8 * time
        # Where they touch, a tooth of one stands in a gap of the other: that gives the small gear's angle up to whole
        # teeth. Its teeth are alike and its marks are not, so it is the angle nearest to that of its speed.
        tooth = ((CONTACT + turned) * LARGE_TEETH / TURN) % 1.0
        pitch = TURN / SMALL_TEETH
        other = CONTACT + math.pi - (0.5 - tooth) * pitch
        other += round((turned * LARGE_TEETH / SMALL_TEETH - other) / pitch) * pitch
        self.large_gear.move(self.large @ rotation((0, 1, 0), turned).T + LARGE_CENTER)
        self.small_gear.move(self.small @ rotation((0, 1, 0), -other).T + SMALL_CENTER)
        spin = rotation((0, 0, 1), TURN * 0.75 * time) @ rotation((1, 0, 0), 1.15 + 0.35 * math.sin(TURN * time))
        self.turning_knot.move(self.knot @ spin.T + KNOT + np.array([0, 0, 0.03 + 0.06 * math.sin(TURN * time)]))
