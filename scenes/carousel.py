"""A carousel: six horses rise and sink on their poles while it turns by half."""

import math

import numpy as np

from kit.meshes import Mesh
from kit.motion import TURN, rotation
from kit.paint import Paint, clouded, color, plain
from kit.shapes import box, joined, lathe, sphere, tube
from kit.studio import lamp, quick_bounces, sky, sun

FLOOR = -0.98
DECK = FLOOR + 0.17
ROOF = 0.30
HORSES = 6
RING = 0.62                       # where the horses stand
SIZE = 0.88                       # of everything, so that no view cuts it off


def ellipsoid(center, radii, lean=0.0):
    """A ball stretched along the axes, and turned about y."""
    vertices, faces = sphere(32, 18)
    return vertices * radii @ rotation((0, 1, 0), lean).T + center, faces


def limb(points, radii):
    """A leg or a neck, round at its ends."""
    points = np.array(points, float)
    share = np.linspace(0, 1, len(points))
    fine = np.linspace(0, 1, 14)
    path = np.stack([np.interp(fine, share, points[:, axis]) for axis in range(3)], -1)
    # Corners become curves.
    for _ in range(3):
        path[1:-1] = (path[:-2] + 2 * path[1:-1] + path[2:]) / 4
    ends = [ellipsoid(path[end], (radius,) * 3) for end, radius in ((0, radii[0]), (-1, radii[-1]))]
    return joined(tube(path, np.interp(fine, np.linspace(0, 1, len(radii)), radii), 18), *ends)


def horse():
    """A horse that looks along +x, with its middle at the origin: body, hair, saddle and hooves."""
    body = [
        ellipsoid((0, 0, 0), (0.170, 0.078, 0.085)),
        ellipsoid((0.105, 0, 0.012), (0.085, 0.074, 0.090)),
        ellipsoid((-0.105, 0, 0.012), (0.088, 0.078, 0.090)),
        limb([(0.12, 0, 0.03), (0.185, 0, 0.12), (0.205, 0, 0.215)], (0.066, 0.050, 0.040)),
        ellipsoid((0.245, 0, 0.218), (0.075, 0.036, 0.038), 0.55),
        ellipsoid((0.288, 0, 0.190), (0.034, 0.028, 0.026), 0.55),
    ]
    hooves = []
    for side in (-1, 1):
        y = 0.046 * side
        body.append(limb([(0.13, y, -0.03), (0.215, y, -0.085), (0.185, y, -0.185)] if side > 0 else
                         [(0.12, y, -0.03), (0.165, y, -0.13), (0.225, y, -0.195)], (0.040, 0.028, 0.019)))
        body.append(limb([(-0.13, y, -0.02), (-0.135, y, -0.12), (-0.205, y, -0.200)] if side > 0 else
                         [(-0.12, y, -0.02), (-0.085, y, -0.12), (-0.130, y, -0.215)], (0.048, 0.030, 0.019)))
        ends = ((0.185, y, -0.198), (-0.212, y, -0.212)) if side > 0 else ((0.232, y, -0.206), (-0.134, y, -0.228))
        hooves += [ellipsoid(end, (0.026, 0.022, 0.020)) for end in ends]
        ear, faces = lathe([(0, 0), (0.013, 0.0), (0.010, 0.022), (0, 0.045)], 12)
        body.append((ear + (0.215, 0.020 * side, 0.240), faces))
    hair = [limb([(-0.185, 0, 0.045), (-0.250, 0, 0.055), (-0.285, 0, -0.03), (-0.275, 0, -0.12)], (0.020, 0.036, 0.030, 0.008))]
    for number in range(9):
        share = number / 8
        at = np.array([0.118 + 0.080 * share, 0, 0.085 + 0.155 * share])
        hair.append(ellipsoid(at + (-0.022 + 0.006 * math.sin(5 * number), 0.012 * (-1) ** number, 0.004), (0.030, 0.018, 0.030), 0.7))
    hair.append(ellipsoid((0.232, 0, 0.262), (0.032, 0.016, 0.016), 0.5))
    seat = [ellipsoid((0.0, 0, 0.052), (0.080, 0.070, 0.050)), ellipsoid((-0.070, 0, 0.088), (0.020, 0.046, 0.036)),
            ellipsoid((0.066, 0, 0.090), (0.016, 0.030, 0.030))]
    blanket, faces = sphere(48, 24)
    blanket = blanket * (0.105, 0.086, 0.092)
    blanket[:, 2] = np.maximum(blanket[:, 2], -0.045)
    return {"body": joined(*body), "hooves": joined(*hooves), "hair": joined(*hair), "seat": joined(*seat), "blanket": (blanket, faces)}


def roof():
    """A round tent with a scalloped edge, and its peak."""
    around, rows = 144, []
    turns = TURN * np.arange(around) / around
    for share in np.linspace(0, 1, 20):
        # Gores hang a little between their ribs.
        sag = 0.018 * math.sin(math.pi * share) * (1 - np.abs(np.cos(6 * turns)))
        radius = 0.02 + 0.93 * share
        rows.append((radius + 0 * turns, 0.86 - 0.56 * share ** 0.72 - sag))
    for drop in (0.0, 0.03, 0.06, 0.085):
        scallop = drop / 0.085 * 0.045 * np.abs(np.sin(12 * turns))
        rows.append((0.955 + 0 * turns, 0.30 - drop - scallop))
    vertices = np.concatenate([np.stack([radius * np.cos(turns), radius * np.sin(turns), height], -1) for radius, height in rows])
    faces = []
    for row in range(len(rows) - 1):
        for step in range(around):
            here, beside = row * around + step, row * around + (step + 1) % around
            faces.append((here, here + around, beside + around, beside))
    return vertices, faces


def roof_paint():
    """Red and cream gores, a blue edge with gold."""
    paint = Paint("roof")
    x, y, z = paint.at().parts()
    gores = (y.angle(x) * (6 / TURN) + 12.25).fraction()
    weave = paint.noise(paint.at(), 60, 2)
    # Half a turn brings each color to where it was.
    shade = gores.ramp([(0, color("#c22a35")), (0.5, color("#fff1d6"))], steps=True)
    thirds = (y.angle(x) * (2 / TURN) + 8.0).fraction()
    accent = thirds.ramp([(0, color("#c22a35")), (1 / 3, color("#1f7a8c")), (2 / 3, color("#e2a32b"))], steps=True)
    shade = paint.mix(gores.below(0.5, 0.004), shade, accent)
    shade = paint.mix(z.below(0.298, 0.002), shade, color("#24356b"))
    shade = paint.mix(z.between(0.284, 0.298, 0.002), shade, color("#efc24f"))
    beads = abs((y.angle(x) * (24 / TURN) + 24.0).fraction() - 0.5).below(0.12, 0.03) * z.between(0.235, 0.262, 0.004)
    shade = paint.mix(beads, shade, color("#ffe08a"))
    return paint.surface(paint.mix(weave * 0.12, shade, color("#4a3a35")), 0.55, sheen=0.3)


def deck_paint():
    """Planks that run outward, and a painted rim."""
    paint = Paint("deck")
    at = paint.at()
    x, y, z = at.parts()
    distance = (x * x + y * y).root()
    turn = y.angle(x)
    planks = (turn * (48 / TURN) + 48.0).fraction()
    gap = abs(planks - 0.5).above(0.465, 0.015)
    number = (turn * (48 / TURN) + 48.0).floor()
    grain = paint.noise(paint.vector(distance * 4.0, turn * 30.0, number * 1.7), 1.0, 4)
    shade = grain.ramp([(0.3, color("#8a5a33")), (0.5, color("#b98450")), (0.7, color("#dcb27c"))])
    shade = paint.mix(gap, shade, color("#3a2415"))
    star = abs((turn * (12 / TURN) + 12.0).fraction() - 0.5)
    rim = z.below(-0.012, 0.003)
    side = paint.mix(star.below(0.12, 0.01), color("#f3e6c8"), color("#b3263a"))
    shade = paint.mix(rim, shade, side)
    return paint.surface(shade, 0.4, coat=0.2)


def center_paint():
    """Panels with mirrors' blue, framed in gold."""
    paint = Paint("center")
    at = paint.at()
    x, y, z = at.parts()
    across = abs((y.angle(x) * (6 / TURN) + 12.0).fraction() - 0.5)
    height = abs((z - 0.58) * 2.0)
    oval = (across * across * 7.5 + height * height * 1.3).root()
    shade = paint.mix(oval.below(0.78, 0.02), color("#f6e9cc"), color("#d99d2b"))
    inner = (paint.noise(at, 5, 3) * 0.5 + z * 0.5).ramp([(0.35, color("#2c4f93")), (0.75, color("#9fd0e8"))])
    shade = paint.mix(oval.below(0.68, 0.02), shade, inner)
    shade = paint.mix(across.above(0.465, 0.01), shade, color("#b3263a"))
    return paint.surface(shade, 0.3, coat=0.4)


class Scene:
    """See above."""

    seed = 14
    samples = 8

    def build(self):
        """Makes everything, at time 0."""
        quick_bounces()
        sky((0.86, 0.90, 1.0), (0.48, 0.40, 0.34), 1.0)
        sun("key", (44, 8, 36), 2.5, (1.0, 0.94, 0.84), 7)
        lamp("front", (-2.4, -3.0, 0.5), (0, 0, -0.3), 2.2, 70, (1.0, 0.93, 0.85))
        lamp("side", (3.0, 2.0, 0.3), (0, 0, -0.3), 2.2, 50, (0.86, 0.92, 1.0))
        gold = clouded("gold", "#b98421", "#f7d77d", 6, 0.22, 1.0)
        stone = Paint("stone")
        blocks = stone.bricks(stone.at() + 5.0, 4.0, color("#9fa3a8"), color("#c9c6be"), color("#77736c"))
        vertices, faces = lathe([(0, -.10), (1.0, -.10), (1.03, -.08), (1.03, -.02), (1.0, 0), (0, 0)], 128)
        Mesh("ground", (vertices + (0, 0, FLOOR + 0.05)) * SIZE, faces, stone.surface(blocks, 0.75), rest=vertices, smooth=False, still=True)
        # All of this turns together.
        self.turning = []

        def add(name, shape, material, rest=None, smooth=True):
            vertices, faces = shape
            self.turning.append((Mesh(name, vertices, faces, material, rest=rest, smooth=smooth), vertices))

        vertices, faces = lathe([(0, -.07), (.93, -.07), (.955, -.055), (.955, -.012), (.94, 0), (0, 0)], 128)
        add("deck", (vertices + (0, 0, DECK), faces), deck_paint(), rest=vertices, smooth=False)
        vertices, faces = lathe([(0, 0), (.27, 0), (.27, .06), (.235, .09), (.225, 1.05), (.26, 1.09), (.26, 1.13), (0, 1.13)], 72)
        add("center", (vertices + (0, 0, DECK), faces), center_paint(), rest=vertices, smooth=False)
        add("roof", roof(), roof_paint())
        vertices, faces = lathe([(0, 0), (.03, 0), (.02, .04), (.055, .09), (.02, .14), (.012, .26), (0, .27)], 32)
        add("peak", (vertices + (0, 0, 0.84), faces), gold)
        flag, faces = box(0.15, 0.006, 0.075, 0.002, 1)
        add("pennant", (flag + (0.085, 0, 1.06), faces), plain("pennant", "#d7263d", 0.6), smooth=False)
        vertices, faces = lathe([(.93, 0), (.962, 0), (.968, .02), (.962, .04), (.93, .04), (.93, 0)], 128)
        add("ring", (vertices + (0, 0, ROOF - 0.02), faces), gold)
        bulbs = []
        for number in range(24):
            turn = TURN * (number + 0.5) / 24
            ball, ball_faces = sphere(14, 8)
            bulbs.append((ball * 0.019 + (0.975 * math.cos(turn), 0.975 * math.sin(turn), ROOF + 0.005), ball_faces))
        bulb = Paint("bulb")
        add("bulbs", joined(*bulbs), bulb.surface(color("#fff0c0"), 0.3, glow=color("#ffd98a")))

        # Three pairs: half a turn brings each horse to where its twin was.
        coats = [("#f5f0e6", "#cfc4b4", "#6b4a34", "#b3263a", "#efc24f"), ("#5a3a28", "#8a5a3a", "#1c120c", "#1f7a8c", "#f3e6c8"),
                 ("#8f959c", "#c6cbd0", "#f7f4ec", "#5a3d8f", "#f2a7b8")]
        shape = horse()
        self.horses = []
        for number in range(HORSES):
            light, dark, mane, blanket, trim = coats[number % 3]
            name = f"horse {number}"
            paint = Paint(f"{name} coat")
            at = paint.at()
            x, y, z = at.parts()
            dapple = paint.noise(at, 22, 3, 0.6)
            shade = dapple.ramp([(0.35, color(dark)), (0.6, color(light))])
            eye = ((x - 0.252) * (x - 0.252) + (z - 0.232) * (z - 0.232)).root().below(0.010, 0.002) * abs(y).above(0.02, 0.003)
            shade = paint.mix(eye, shade, color("#0c0a0a"))
            bridle = (x * 0.8 - z).between(-0.022, -0.010, 0.002) * z.above(0.14, 0.01)
            shade = paint.mix(bridle, shade, color(blanket))
            cloth = Paint(f"{name} blanket")
            x, y, z = cloth.at().parts()
            border = z.below(-0.028, 0.002).larger(abs(x).above(0.088, 0.002))
            dots = cloth.cells(cloth.at(), 34.0, randomness=0.0).below(0.24, 0.05)
            woven = cloth.mix(dots, color(blanket), color(trim))
            woven = cloth.mix(border, woven, color(trim))
            materials = {"body": paint.surface(shade, 0.35, coat=0.4), "hooves": gold, "hair": clouded(f"{name} hair", mane, light, 26, 0.5),
                         "seat": plain(f"{name} seat", "#7a2f1d", 0.35, coat=0.3), "blanket": cloth.surface(woven, 0.6, sheen=0.3)}
            parts = []
            for part, (vertices, faces) in shape.items():
                parts.append((Mesh(f"{name} {part}", vertices, faces, materials[part], rest=vertices), vertices * 1.22))
            self.horses.append((parts, TURN * number / HORSES))
            pole = Paint(f"{name} pole")
            x, y, z = pole.at().parts()
            spiral = (y.angle(x) * (1 / TURN) + z * 7.0 + 10.0).fraction()
            striped = pole.surface(pole.mix(spiral.above(0.5, 0.03), color("#f2c653"), color("#fbf2dc")), 0.25, 0.3)
            vertices, faces = lathe([(0, DECK), (.040, DECK), (.022, DECK + .03), (.014, DECK + .05), (.014, ROOF + .10), (0, ROOF + .10)], 24)
            turn = TURN * number / HORSES
            add(f"pole {number}", (vertices + (RING * math.cos(turn), RING * math.sin(turn), 0), faces), striped, rest=vertices)
        self.move(0.0)

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        spin = SIZE * rotation((0, 0, 1), TURN / 2 * time)
        for part, vertices in self.turning:
            part.move(vertices @ spin.T)
        for number, (parts, turn) in enumerate(self.horses):
            # Neighbors rise by turns; a twin does what its twin does.
            rise = 0.085 * math.sin(TURN * (2 * time + (number % 3) / 3))
            rock = rotation((0, 1, 0), -0.09 * math.cos(TURN * (2 * time + (number % 3) / 3)))
            ahead = rotation((0, 0, 1), turn + math.pi / 2)
            at = np.array([RING * math.cos(turn), RING * math.sin(turn), DECK + 0.44 + rise])
            for part, vertices in parts:
                part.move(((vertices @ rock.T) @ ahead.T + at) @ spin.T)
