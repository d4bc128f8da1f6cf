"""A jellyfish that swims: its bell opens and closes, and arms and tentacles follow, later the farther down."""

import math

import numpy as np

from kit.meshes import Mesh
from kit.motion import TURN, rotation, smooth
from kit.paint import Paint, clouded, color
from kit.shapes import grid_faces, lathe, sphere, tube, tube_vertices
from kit.studio import lamp, quick_bounces, sky, sun

FLOOR = -1.04
BELL_AROUND, BELL_DOWN = 128, 40
LOBES = 16
TENTACLES, TENTACLE_POINTS = 14, 40
ARMS, ARM_POINTS, ARM_ACROSS = 4, 48, 9
BEATS = 2


def closing(time):
    """How far the bell is closed, from 0 to 1: quick to close, slow to open."""
    share = (BEATS * time) % 1.0
    return float(smooth(share / 0.38) if share < 0.38 else smooth((1 - share) / 0.62))


def bell(time):
    """Vertices of the bell about its middle, outside and then inside, and the radius and height of its rim."""
    turns = TURN * np.arange(BELL_AROUND) / BELL_AROUND
    closed = closing(time)
    lagging = closing(time - 0.035)
    surfaces = []
    for thickness in (0.0, 0.045):
        rows = []
        for share in np.linspace(0.001, 1, BELL_DOWN):
            # From the crown down to the rim, which closes a little later than what is above it.
            here = closed + (lagging - closed) * share
            spread = 0.72 - 0.19 * here * share
            radius = (spread - thickness * (1 - 0.8 * share)) * math.sin(min(share * 1.72, 1.62))
            height = (0.46 + 0.06 * here) * math.cos(share * 1.66) - thickness * (1 - share) - 0.05 * here * share
            scallop = smooth((share - 0.72) / 0.28)
            rows.append(np.stack([
                radius * (1 + 0.035 * scallop * np.cos(LOBES * turns)) * np.cos(turns),
                radius * (1 + 0.035 * scallop * np.cos(LOBES * turns)) * np.sin(turns),
                height - 0.035 * scallop * np.abs(np.cos(LOBES / 2 * turns)) + 0 * turns,
            ], -1))
        surfaces.append(np.stack(rows))
    outside, inside = surfaces
    # One sheet: down the outside, around the rim, and up the inside.
    return np.concatenate([outside, inside[::-1]]).reshape(-1, 3), (outside[-1, :, :2] ** 2).sum(-1).mean() ** 0.5, outside[-1, :, 2].mean()


def hanging(time, turn, radius, top, length, points, slack, number):
    """A line from the rim downward. A wave of the beat runs along it, and it sways with a phase of its own."""
    share = np.linspace(0, 1, points)
    delayed = np.array([closing(time - 0.16 * s) for s in share])
    out = radius * (1 - 0.35 * share) + 0.16 * (0.5 - delayed) * share
    sway = slack * share * np.sin(TURN * (time + 0.618 * number) - 4.2 * share)
    twist = turn + (sway + 0.05 * share * np.sin(9 * share + number)) / np.maximum(out, 0.08)
    height = top - length * share * (1 - 0.10 * delayed)
    return np.stack([out * np.cos(twist), out * np.sin(twist), height], -1)


def ruffle(time, turn, number):
    """An arm: a ribbon with curled edges that hangs from the middle."""
    line = hanging(time, turn, 0.13, 0.10, 1.15, ARM_POINTS, 0.16, number + 0.4)
    share = np.linspace(0, 1, ARM_POINTS)[:, None]
    across = np.linspace(-1, 1, ARM_ACROSS)[None]
    width = 0.15 * (1 - 0.75 * share) * np.minimum(share * 7 + 0.35, 1)
    side = np.array([-math.sin(turn), math.cos(turn), 0])
    front = np.array([math.cos(turn), math.sin(turn), 0])
    curl = 0.055 * (1 - 0.5 * share) * across ** 2 * np.sin(34 * share + 2.5 * np.sign(across) + number - TURN * time)
    return (line[:, None] + (width * across)[..., None] * side + curl[..., None] * front).reshape(-1, 3)


def bell_paint():
    """Violet with bright ribs; darker seen from inside."""
    paint = Paint("bell")
    x, y, z = paint.at().parts()
    turn = y.angle(x)
    down = paint.at("down").parts()[0]
    ribs = (turn * float(LOBES)).cosine()
    shade = down.ramp([(0.0, color("#ffd9c2")), (0.25, color("#f58fb0")), (0.60, color("#9a4fc4")), (0.92, color("#4a3aa8")), (1.0, color("#ffd08a"))])
    spots = paint.cells(paint.at(), 6.5).below(0.26, 0.05) * down.between(0.2, 0.8, 0.05)
    shade = paint.mix(spots * 0.8, shade, color("#fff0d8"))
    shade = paint.mix(ribs.above(0.80, 0.14) * down.between(0.12, 0.93, 0.06) * 0.75, shade, color("#ffe3ee"))
    leaf = abs((turn * 2.0).cosine()).above(0.72, 0.06) * down.between(0.10, 0.34, 0.03)
    shade = paint.mix(leaf, shade, color("#ff7a59"))
    shade = paint.mix(paint.backside(), shade, paint.mix(0.55, shade, color("#3b1c66")))
    return paint.surface(shade, 0.25, coat=0.5, glow=paint.mix(0.86, shade, (0, 0, 0)))


def ribbon_paint():
    """Cream to coral along the arm, the edges bright."""
    paint = Paint("arms")
    across, along, _ = paint.at().parts()
    shade = along.ramp([(0.0, color("#ffe9d2")), (0.35, color("#ffb08a")), (0.75, color("#ff6f7d")), (1.0, color("#c2418f"))])
    shade = paint.mix(abs(across).above(0.72, 0.08), shade, color("#fff7e6"))
    veins = abs((along * 26.0 + abs(across) * 2.0).fraction() - 0.5).below(0.10, 0.05) * 0.4
    return paint.surface(paint.mix(veins, shade, color("#a8306d")), 0.4, sheen=0.2, glow=paint.mix(0.88, shade, (0, 0, 0)))


def sand_paint():
    """Ripples of sand with pebbles."""
    paint = Paint("sand")
    at = paint.at()
    ripples = paint.bands(at + paint.noise(at, 2.2, 2) * 0.5, 2.2, 6.0, 4.0, "Y")
    shade = ripples.ramp([(0.0, color("#cbab76")), (0.5, color("#e3c994")), (1.0, color("#f2e2ba"))])
    pebbles = paint.cells(at, 11.0).below(0.20, 0.04) * paint.noise(at, 2.5, 2).above(0.52, 0.03)
    shade = paint.mix(pebbles, shade, color("#6d7f8f"))
    side = at.parts()[2].below(FLOOR - 0.03, 0.01)
    shade = paint.mix(side, shade, paint.noise(at, 9, 4).ramp([(0.3, color("#7a5c3a")), (0.7, color("#b8935f"))]))
    return paint.surface(shade, 0.9, normal=paint.bump(ripples, 0.3, 0.02))


class Scene:
    """See above."""

    seed = 13
    samples = 8

    def build(self):
        """Makes everything, at time 0."""
        quick_bounces()
        sky((0.62, 0.84, 1.0), (0.30, 0.38, 0.48), 1.0)
        sun("key", (30, 12, 40), 2.6, (1.0, 0.96, 0.90), 6)
        lamp("front", (-2.2, -3.0, 0.6), (0, 0, 0), 2.0, 55, (0.80, 0.90, 1.0))
        vertices, faces = lathe([(0, FLOOR - .10), (.62, FLOOR - .10), (.72, FLOOR - .06), (.74, FLOOR - .02), (.70, FLOOR + .01),
                                 (.40, FLOOR + .035), (0, FLOOR + .04)], 96)
        Mesh("sand", vertices, faces, sand_paint(), still=True)
        self._stones_and_coral()

        vertices, _, _ = bell(0.0)
        rows = 2 * BELL_DOWN
        faces = grid_faces(rows, BELL_AROUND, wrap_columns=True)
        down = np.concatenate([np.linspace(0, 1, BELL_DOWN), np.linspace(1, 0, BELL_DOWN)])
        self.bell = Mesh("bell", vertices, faces, bell_paint())
        self.bell.attribute("down", np.repeat(down, BELL_AROUND)[:, None] * (1, 0, 0))

        share = np.linspace(0, 1, ARM_POINTS)
        rest = np.stack(np.broadcast_arrays(np.linspace(-1, 1, ARM_ACROSS)[None], share[:, None], 0.0), -1).reshape(-1, 3)
        ribbon = ribbon_paint()
        self.arms = []
        for number in range(ARMS):
            turn = TURN * (number + 0.5) / ARMS
            arm = Mesh(f"arm {number}", ruffle(0.0, turn, number), grid_faces(ARM_POINTS, ARM_ACROSS), ribbon, rest=rest)
            self.arms.append((arm, turn))

        self.tentacles = []
        for number in range(TENTACLES):
            paint = Paint(f"tentacle {number}")
            along = paint.at().parts()[0]
            warm = ("#ff9ecb", "#b58cff", "#ffc38a")[number % 3]
            rings = ((along * 16.0).fraction()).below(0.3, 0.06)
            shade = paint.mix(rings, along.ramp([(0, color(warm)), (1, color("#5a3fb0"))]), color("#fff1e0"))
            points = hanging(0.0, 0, 0.5, 0, 1.0, TENTACLE_POINTS, 0.1, number)
            vertices, faces = tube(points, self._thickness(), 10)
            rest = np.repeat(np.linspace(0, 1, TENTACLE_POINTS), 10)
            rest = np.concatenate([rest, [0, 1]])[:, None] * (1, 0, 0)
            material = paint.surface(shade, 0.35, glow=paint.mix(0.9, shade, (0, 0, 0)))
            self.tentacles.append(Mesh(f"tentacle {number}", vertices, faces, material, rest=rest))
        self.move(0.0)

    @staticmethod
    def _thickness():
        return np.linspace(0.021, 0.011, TENTACLE_POINTS)

    @staticmethod
    def _stones_and_coral():
        """What stands on the sand."""
        random = np.random.default_rng(9)
        for number, (x, y, size) in enumerate([(-.48, .22, .17), (-.30, .42, .11), (.50, -.30, .13), (.36, .46, .10), (-.50, -.30, .09)]):
            vertices, faces = sphere(56, 30)
            bumps = 1 + 0.12 * np.sin(5 * vertices[:, 0] + number) * np.sin(4 * vertices[:, 1] - number) + 0.06 * np.sin(11 * vertices[:, 2] + 2 * number)
            shape = vertices * bumps[:, None] * (size, size * 0.9, size * 0.7)
            Mesh(f"stone {number}", shape + (x, y, FLOOR + 0.05), faces, clouded(f"stone {number}", "#4c5a66", "#a9b4b8", 9, 0.7), rest=shape + number, still=True)
        paints = [clouded("coral red", "#c2352f", "#ff8a6b", 14, 0.6), clouded("coral gold", "#d08a1c", "#ffd873", 14, 0.6),
                  clouded("coral teal", "#1c7f86", "#73d6c8", 14, 0.6)]
        for bush, (x, y) in enumerate([(.42, .10), (-.20, -.50), (-.12, .58)]):
            for branch in range(9):
                turn, lean, length = random.uniform(0, TURN), random.uniform(0.15, 0.8), random.uniform(0.16, 0.30)
                share = np.linspace(0, 1, 12)[:, None]
                direction = np.array([math.cos(turn) * lean, math.sin(turn) * lean, 1.0])
                bend = np.array([math.cos(turn + 1), math.sin(turn + 1), 0.0]) * random.uniform(-0.05, 0.05)
                path = np.array([x, y, FLOOR + 0.01]) + share * length * direction + share ** 2 * bend
                radii = 0.026 * (1 - 0.45 * share[:, 0]) * (1 + 0.2 * np.sin(30 * share[:, 0]))
                vertices, faces = tube(path, radii, 14)
                Mesh(f"coral {bush} {branch}", vertices, faces, paints[bush], still=True)
                knob, faces = sphere(20, 10)
                Mesh(f"knob {bush} {branch}", knob * 0.024 + path[-1], faces, paints[bush], still=True)

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        vertices, radius, rim = bell(time)
        # It rises as it closes, and sinks while it opens.
        at = np.array([0.06 * math.sin(TURN * time), 0.05 * math.cos(TURN * time), 0.52 + 0.11 * math.sin(TURN * (BEATS * time - 0.30))])
        lean = rotation((1, 0, 0), 0.10 * math.sin(TURN * time)) @ rotation((0, 1, 0), 0.12 * math.cos(TURN * time))
        lean = lean @ rotation((0, 0, 1), 0.35 * math.sin(TURN * time))

        def placed(points):
            return points @ lean.T + at

        self.bell.move(placed(vertices))
        for number, (arm, turn) in enumerate(self.arms):
            arm.move(placed(ruffle(time, turn, number)))
        for number, tentacle in enumerate(self.tentacles):
            length = 1.05 + 0.22 * math.sin(2.4 * number)
            points = hanging(time, TURN * number / TENTACLES, radius * 0.97, rim, length, TENTACLE_POINTS, 0.10, number)
            tentacle.move(placed(tube_vertices(points, self._thickness(), 10)))
