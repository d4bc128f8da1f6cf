"""A windmill on an island in the air: its sails turn, clouds drift about it, and a balloon rises and sinks."""

import math

import numpy as np

from kit.meshes import Mesh
from kit.motion import TURN, rotation
from kit.paint import Paint, clouded, color
from kit.shapes import box, joined, lathe, sphere, tube
from kit.studio import lamp, quick_bounces, sky, sun

GROUND = -0.64
TOWER = np.array([0.08, 0.08, GROUND])
HUB = np.array([0.08, -0.30, 0.40])


def island():
    """A round top with a little hill, and rock that runs out below."""
    rings, around = 46, 144
    random = np.random.default_rng(5)
    waves = [(number, random.uniform(0, TURN), random.uniform(0.4, 1.0) / number) for number in range(2, 9)]
    turns = TURN * np.arange(around) / around
    edge = 1.0 + 0.10 * sum(size * np.cos(number * turns + phase) for number, phase, size in waves)
    vertices = []
    for ring in range(1, rings):
        share = ring / rings
        if share < 0.5:
            reach = 2 * share
            height = GROUND + 0.05 * (1 - reach ** 2) + 0.012 * np.sin(5 * turns + 9 * reach) - 0.10 * max(0, reach - 0.86)
            radius = 0.95 * reach * (1 + (edge - 1) * reach)
        else:
            depth = 2 * share - 1
            rough = 1 + 0.09 * np.sin(7 * turns + 11 * depth) * np.sin(4 * turns - 6 * depth) + 0.05 * np.sin(17 * turns + 23 * depth)
            height = GROUND - 0.03 - 0.62 * depth + 0.05 * np.sin(9 * turns + 3) * depth
            radius = 0.95 * edge * (1 - depth) ** 0.72 * rough
        vertices.append(np.stack([radius * np.cos(turns), radius * np.sin(turns), height + 0 * turns], -1))
    top, bottom = [0, 0, GROUND + 0.05], [0, 0, GROUND - 0.70]
    faces = [(0, 1 + step, 1 + (step + 1) % around) for step in range(around)]
    for ring in range(rings - 2):
        for step in range(around):
            here, beside = 1 + ring * around + step, 1 + ring * around + (step + 1) % around
            faces.append((here, here + around, beside + around, beside))
    last, lowest = 1 + (rings - 1) * around, 1 + (rings - 2) * around
    faces += [(lowest + step, last, lowest + (step + 1) % around) for step in range(around)]
    return np.concatenate([[top], *vertices, [bottom]]), faces


def island_paint():
    """Meadow with a path, and layers of rock below."""
    paint = Paint("island")
    at = paint.at()
    x, y, z = at.parts()
    meadow = paint.noise(at, 16, 5, 0.7).ramp([(0.3, color("#3f7a2c")), (0.5, color("#6ba53a")), (0.7, color("#a9cf5c"))])
    flowers = paint.cells(at, 15.0).below(0.16, 0.03) * paint.noise(at, 3.0, 2).above(0.52, 0.02)
    meadow = paint.mix(flowers, meadow, color("#f7f0d8"))
    middle = (y * 4.5).sine() * 0.12 + 0.04
    path = abs(x - middle).below(0.075, 0.012) * y.below(-0.18, 0.02)
    meadow = paint.mix(path, meadow, paint.noise(at, 30, 3).ramp([(0.3, color("#b99567")), (0.7, color("#e6cfa0"))]))
    layers = paint.noise(paint.vector(x * 2.0, y * 2.0, z * 14.0), 1.5, 5, 0.6, 0.6)
    rock = layers.ramp([(0.3, color("#4b362b")), (0.45, color("#8a6547")), (0.58, color("#b08a62")), (0.7, color("#6d6a72"))])
    soil = z.above(GROUND - 0.10, 0.025)
    rock = paint.mix(soil, rock, color("#5a3a20"))
    return paint.surface(paint.mix(z.above(GROUND - 0.045, 0.012), rock, meadow), 0.85, normal=paint.bump(layers, 0.35, 0.03))


def tower_paint():
    """White plaster with a band of bricks, a door and windows."""
    paint = Paint("tower")
    at = paint.at()
    x, y, z = at.parts()
    turn = y.angle(x)
    cloud = paint.noise(at, 9, 4)
    plaster = cloud.ramp([(0.3, color("#d8cdb8")), (0.65, color("#fbf6ea"))])
    bricks = paint.bricks(paint.vector(turn * 0.45 + 5.0, z + 5.0, 0.0), 7.0, color("#a4503c"), color("#c9825c"), color("#e8ddc8"))
    shade = paint.mix(z.below(0.24, 0.004), plaster, bricks)
    front = abs(turn + math.pi / 2)
    door = front.below(0.30, 0.01) * z.below(0.215, 0.005)
    shade = paint.mix(front.below(0.36, 0.01) * z.below(0.24, 0.005), shade, color("#efe4cf"))
    shade = paint.mix(door, shade, paint.bands(paint.vector(turn, z, 0.0), 9.0, 1.0).ramp([(0.2, color("#1f5f73")), (0.8, color("#3c8ea0"))]))
    across = abs((turn * (4 / TURN) + 0.5 + 8.0).fraction() - 0.5)
    frame = across.below(0.062, 0.004) * z.between(0.47, 0.63, 0.003)
    pane = across.below(0.045, 0.003) * z.between(0.485, 0.615, 0.003)
    cross = across.below(0.006, 0.002).larger(z.between(0.547, 0.556, 0.002))
    shade = paint.mix(frame, shade, color("#7c4a28"))
    shade = paint.mix(pane * (1.0 - cross), shade, color("#ffd98a"))
    return paint.surface(shade, 0.7, normal=paint.bump(cloud, 0.15, 0.01))


def sail():
    """A blade along z: a spar, rungs, and cloth beside it."""
    parts = [tuple(box(0.028, 0.028, 0.78, 0.006, 1))]
    parts[0] = (parts[0][0] + (0, 0, 0.39), parts[0][1])
    for height in np.linspace(0.20, 0.74, 5):
        rung, faces = box(0.20, 0.012, 0.014, 0.003, 1)
        parts.append((rung + (0.085, 0, height), faces))
    return joined(*parts)


def cloth():
    """The canvas of a blade, bent a little by the wind."""
    across, along = 9, 24
    vertices = []
    for side in (0.012, -0.004):
        for row in range(along):
            for column in range(across):
                u, v = column / (across - 1), row / (along - 1)
                vertices.append((0.016 + 0.165 * u, side + 0.045 * u * u, 0.19 + 0.56 * v))
    one = across * along
    faces = []
    for row in range(along - 1):
        for column in range(across - 1):
            here = row * across + column
            face = (here, here + 1, here + across + 1, here + across)
            faces += [face[::-1], tuple(index + one for index in face)]
    return np.array(vertices), faces


def cloth_paint(name, stripe):
    """Canvas with stripes of a color."""
    paint = Paint(name)
    x, y, z = paint.at().parts()
    stripes = ((z * 7.2).fraction()).above(0.5, 0.02)
    weave = paint.noise(paint.at() * (60.0, 1.0, 60.0), 1.0, 2)
    shade = paint.mix(stripes, color("#fff6e0"), color(stripe))
    return paint.surface(paint.mix(weave * 0.18, shade, color("#8a7a60")), 0.8, sheen=0.2)


def cloud(random, size):
    """A few balls that grow together: the nearer of their surfaces in each direction from the middle."""
    vertices, faces = sphere(72, 40)
    balls = [(np.zeros(3), 0.62)]
    for number in range(6):
        turn = TURN * number / 6 + random.uniform(-0.3, 0.3)
        balls.append((np.array([0.62 * math.cos(turn), 0.34 * math.sin(turn), random.uniform(-0.05, 0.22)]), random.uniform(0.34, 0.52)))
    reach = np.zeros(len(vertices))
    for center, radius in balls:
        # How far a ray from the middle goes before it leaves this ball.
        along = vertices @ center
        inside = along ** 2 - center @ center + radius ** 2
        reach = np.maximum(reach, np.where(inside > 0, along + np.sqrt(np.maximum(inside, 0)), 0))
    shaped = vertices * reach[:, None]
    # Flat below.
    shaped[:, 2] = np.where(shaped[:, 2] < -0.18, -0.18 + 0.25 * (shaped[:, 2] + 0.18), shaped[:, 2])
    return shaped * size, faces


class Scene:
    """See above."""

    seed = 12
    samples = 8

    def build(self):
        """Makes everything, at time 0."""
        quick_bounces()
        sky((0.70, 0.84, 1.0), (0.46, 0.42, 0.36), 0.95)
        sun("key", (46, 10, 30), 3.0, (1.0, 0.93, 0.80), 5)
        lamp("fill", (-2.6, -2.6, 1.6), (0, 0, 0), 2.0, 45, (0.86, 0.92, 1.0))
        vertices, faces = island()
        Mesh("island", vertices, faces, island_paint(), still=True)
        wood = clouded("wood", "#4e2c17", "#8d5930", 10, 0.6)
        vertices, faces = lathe([(0, 0), (.275, 0), (.27, .02), (.262, .24), (.25, .245), (.185, .84), (.205, .86), (.205, .885), (0, .885)], 72)
        Mesh("tower", vertices + TOWER, faces, tower_paint(), rest=vertices, smooth=False, still=True)
        cap, faces = lathe([(0, .885), (.215, .885), (.22, .90), (.20, .96), (.15, 1.05), (.08, 1.12), (.02, 1.15), (.02, 1.19), (0, 1.2)], 72)
        paint = Paint("cap")
        x, y, z = paint.at().parts()
        rows = (z * 26.0).fraction()
        tiles = ((y.angle(x) * (18 / TURN) + (z * 26.0).floor() * 0.5 + 40.0).fraction())
        dark = rows.below(0.16, 0.05).larger(abs(tiles - 0.5).above(0.45, 0.03))
        shade = paint.mix(dark, paint.noise(paint.at(), 8, 3).ramp([(0.3, color("#9c2f2a")), (0.7, color("#d6603f"))]), color("#55191a"))
        Mesh("cap", cap + TOWER, faces, paint.surface(shade, 0.5), rest=cap, smooth=False, still=True)
        vertices, faces = tube(np.array([TOWER + (0, 0.05, 1.04), HUB + (0, -0.02, 0)]), 0.035, 24)
        Mesh("shaft", vertices, faces, wood, still=True)

        self.blades = []
        canvas, canvas_faces = cloth()
        frame, frame_faces = sail()
        for number, stripe in enumerate(("#c8322f", "#2468a8", "#e0a021", "#2d8a57")):
            turned = rotation((0, 1, 0), TURN * number / 4)
            # Pitched, as a real one is.
            pitch = rotation((0, 0, 1), 0.25)
            for part, part_faces, material in ((frame, frame_faces, wood), (canvas, canvas_faces, cloth_paint(f"canvas {number}", stripe))):
                shaped = part @ pitch.T @ turned.T
                self.blades.append((Mesh(f"blade {number} {material.name}", shaped, part_faces, material, rest=part, smooth=False), shaped))
        ball, ball_faces = sphere(40, 20)
        self.blades.append((Mesh("hub", ball * 0.065, ball_faces, clouded("brass", "#a87a22", "#f0cd70", 8, 0.25, 1.0)), ball * 0.065))

        random = np.random.default_rng(21)
        bark = clouded("bark", "#4a2f1c", "#7a5534", 14, 0.8)
        for number, (x, y, size) in enumerate([(-.52, .28, 1.0), (-.66, -.02, .72), (-.34, .52, .8), (.62, .42, .9), (.70, -.10, .65), (.46, .62, .7)]):
            trunk, faces = lathe([(0, 0), (.032, 0), (.02, .05), (.016, .2), (0, .2)], 20)
            foot = np.array([x, y, GROUND + 0.01])
            Mesh(f"trunk {number}", trunk * size + foot, faces, bark, rest=trunk, still=True)
            shape, faces = sphere(48, 26)
            bumps = 1 + 0.13 * np.sin(7 * shape[:, 0] * 3 + number) * np.sin(6 * shape[:, 1] * 3) + 0.08 * np.sin(19 * shape[:, 2] + 5 * shape[:, 0])
            if number % 2:
                crown = shape * bumps[:, None] * (0.135, 0.135, 0.15) + (0, 0, 0.28)
            else:
                crown, faces = lathe([(0, .12), (.14, .13), (.085, .24), (.115, .24), (.06, .36), (.085, .355), (0, .52)], 40)
            paint = Paint(f"leaves {number}")
            shade = paint.noise(paint.at(), 30, 4, 0.7).ramp([(0.3, color("#1f5a2a")), (0.5, color("#3c8637")), (0.7, color("#8abf4e"))])
            Mesh(f"crown {number}", crown * size + foot, faces, paint.surface(shade, 0.8), rest=crown, still=True)
        for turn in np.linspace(-0.93, 3.20, 12):
            post, faces = box(0.022, 0.022, 0.12, 0.004, 1)
            at = np.array([0.80 * math.cos(turn), 0.80 * math.sin(turn), GROUND + 0.05])
            Mesh(f"post {turn:.2f}", post + at, faces, wood, rest=post, smooth=False, still=True)
        for height in (0.045, 0.085):
            turns = np.linspace(-0.95, 3.22, 60)
            path = np.stack([0.80 * np.cos(turns), 0.80 * np.sin(turns), GROUND + height + 0 * turns], -1)
            vertices, faces = tube(path, 0.008, 8)
            Mesh(f"rail {height}", vertices, faces, wood, still=True)

        paint = Paint("cloud")
        shade = paint.noise(paint.at(), 4, 4).ramp([(0.3, color("#e3e9f4")), (0.65, color("#ffffff"))])
        white = paint.surface(shade, 1.0, glow=(0.10, 0.11, 0.13))
        self.clouds = []
        for number, (turn, reach, height, size) in enumerate([(0.3, .98, .80, .27), (2.2, 1.05, .42, .22), (3.9, .95, .92, .24), (5.2, 1.02, .18, .20)]):
            shape, faces = cloud(random, size)
            self.clouds.append((Mesh(f"cloud {number}", shape, faces, white, rest=shape + number), shape, turn, reach, height))

        envelope, faces = lathe([(0, -.215), (.035, -.21), (.07, -.16), (.13, -.06), (.16, .02), (.165, .07), (.14, .14), (.085, .19), (0, .21)], 64)
        paint = Paint("balloon")
        x, y, z = paint.at().parts()
        gores = (y.angle(x) * (4 / TURN) + 8.0).fraction()
        shade = gores.ramp([(0, color("#d7263d")), (.25, color("#f9c22e")), (.5, color("#1b998b")), (.75, color("#f6f1e4"))], steps=True)
        shade = paint.mix(z.between(0.0, 0.035, 0.002), shade, color("#2e294e"))
        basket, basket_faces = box(0.07, 0.07, 0.06, 0.012, 2)
        ropes = [tube(np.array([[.03 * a, .03 * b, -.30], [.045 * a, .045 * b, -.19]]), 0.004, 6) for a in (-1, 1) for b in (-1, 1)]
        carried, carried_faces = joined((basket + (0, 0, -0.325), basket_faces), *ropes)
        self.balloon = [(Mesh("balloon", envelope, faces, paint.surface(shade, 0.45, coat=0.2)), envelope),
                        (Mesh("basket", carried, carried_faces, clouded("wicker", "#6b4522", "#b98a4e", 30, 0.7), smooth=False), carried)]
        self.move(0.0)

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        spin = rotation((0, 1, 0), TURN * time + 0.3)
        for blade, vertices in self.blades:
            blade.move(vertices @ spin.T + HUB + (0, -0.05, 0))
        for number, (drifting, vertices, turn, reach, height) in enumerate(self.clouds):
            now = turn + 0.55 * math.sin(TURN * (time + number * 0.21))
            at = np.array([reach * math.cos(now), reach * math.sin(now), height - 0.16 + 0.03 * math.sin(TURN * (2 * time + number / 4))])
            drifting.move(vertices @ rotation((0, 0, 1), now + math.pi / 2).T + at)
        at = np.array([-0.62 + 0.10 * math.sin(TURN * time), -0.45 + 0.10 * math.cos(TURN * time), 0.40 + 0.22 * math.sin(TURN * time)])
        lean = rotation((1, 0, 0), 0.10 * math.sin(TURN * 2 * time)) @ rotation((0, 0, 1), 0.5 * math.sin(TURN * time))
        for part, vertices in self.balloon:
            part.move(vertices @ lean.T + at)
