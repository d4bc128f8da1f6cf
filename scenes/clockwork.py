"""A skeleton clock: a train of brass gears, an escape wheel, and a pendulum that swings three times."""

import math

import numpy as np

from kit.meshes import Mesh
from kit.motion import TURN, rotation
from kit.paint import Paint, clouded, color, plain
from kit.shapes import box, joined, lathe, sphere, tube
from kit.studio import lamp, quick_bounces, sky, sun

FLOOR = -1.0
FACE = 0.02                       # the plane of the gears, toward -y
# Teeth, and what a wheel does over the whole time in turns of the first one. Neighbors mesh: the products agree.
TOOTH = 0.0136                    # radius for each tooth, so that all mesh
GREAT, CENTER, THIRD, ESCAPE = 26, 13, 20, 15


def toothed(teeth, radius, depth, hole, spokes):
    """A wheel about the axis y: rim with teeth, spokes, and a hub."""
    outer, inner = radius + 0.026, radius - 0.030
    around = []
    for tooth in range(teeth):
        for share, reach in ((-0.30, inner), (-0.14, outer), (0.14, outer), (0.30, inner)):
            around.append((reach, TURN * (tooth + share) / teeth))
    count = len(around)

    def ring(scale_to, y):
        return [((scale_to or reach) * math.cos(turn), y, (scale_to or reach) * math.sin(turn)) for reach, turn in around]

    rim = inner * 0.80
    vertices = np.array(ring(None, -depth / 2) + ring(rim, -depth / 2) + ring(rim, depth / 2) + ring(None, depth / 2))
    faces = []
    for step in range(count):
        beside = (step + 1) % count
        for row in range(4):
            next_row = (row + 1) % 4
            faces.append((row * count + step, row * count + beside, next_row * count + beside, next_row * count + step)[::-1])
    parts = [(vertices, faces)]
    for spoke in range(spokes):
        bar, bar_faces = box(rim - hole + 0.02, depth * 0.7, 0.045, 0.008, 2)
        bar = bar + np.array([(rim + hole) / 2, 0, 0])
        parts.append((bar @ rotation((0, 1, 0), -TURN * spoke / spokes).T, bar_faces))
    hub, hub_faces = lathe([(0, -depth), (hole + 0.012, -depth), (hole + 0.02, -depth * 0.7), (hole + 0.02, depth * 0.7),
                            (hole + 0.012, depth), (0, depth)], 40)
    parts.append((hub @ rotation((1, 0, 0), -math.pi / 2).T, hub_faces))
    return joined(*parts)


def brass(name, dark="#9a6a1e", light="#e9c060", mark="#b3202a"):
    """Turned brass: fine rings, and a red mark at one spoke, without which a wheel that turns looks as before."""
    paint = Paint(name)
    x, y, z = paint.at().parts()
    distance = (x * x + z * z).root()
    rings = paint.noise(paint.vector(distance * 70.0, y * 4.0, 0.0), 1.0, 3)
    cloud = paint.noise(paint.at(), 7.0, 3)
    shade = (rings * 0.6 + cloud * 0.4).ramp([(0.36, color(dark)), (0.62, color(light))])
    marked = z.angle(x).cosine().above(0.93, 0.01) * distance.above(0.08, 0.004)
    shade = paint.mix(marked, shade, color(mark))
    return paint.surface(shade, roughness=0.28 + cloud * 0.15, metal=1.0 - marked * 0.8)


def walnut():
    """The base."""
    paint = Paint("walnut")
    at = paint.at()
    grain = paint.bands(at * (1.0, 6.0, 6.0), 1.6, 5.0, 3.0, "Y", 1.5)
    return paint.surface(grain.ramp([(0.1, color("#3a1d10")), (0.6, color("#6e3b1f")), (0.95, color("#91572f"))]), 0.28, coat=0.4)


def dial():
    """A white ring with hours and minutes."""
    paint = Paint("dial")
    x, y, z = paint.at().parts()
    distance = (x * x + z * z).root()
    turn = z.angle(x) * (1 / TURN)
    minutes = abs((turn * 60.0 + 0.5 + 60.0).fraction() - 0.5).below(0.10, 0.02) * distance.between(0.315, 0.345, 0.001)
    hours = abs((turn * 12.0 + 0.5 + 12.0).fraction() - 0.5).below(0.055, 0.006) * distance.between(0.255, 0.345, 0.001)
    line = distance.between(0.347, 0.352, 0.001).larger(distance.between(0.247, 0.251, 0.001))
    shade = paint.mix(minutes.larger(hours).larger(line), color("#f4efe2"), color("#16233f"))
    return paint.surface(shade, 0.3, coat=0.3)


def direction(degrees):
    """A unit vector in the plane of the wheels, from +x toward +z."""
    return np.array([math.cos(math.radians(degrees)), 0, math.sin(math.radians(degrees))])


class Scene:
    """See above."""

    seed = 11
    samples = 8

    def build(self):
        """Makes everything, at time 0."""
        quick_bounces()
        sky((0.95, 0.97, 1.0), (0.42, 0.36, 0.30), 0.9)
        sun("key", (42, 8, 28), 2.2, (1.0, 0.94, 0.84), 8)
        lamp("front", (-1.8, -3.4, 1.4), (0, 0, 0), 2.2, 90, (0.92, 0.95, 1.0))
        lamp("back", (1.6, 3.2, 1.8), (0, 0, 0), 2.2, 70, (1.0, 0.9, 0.78))
        steel = plain("steel", "#2c3f74", 0.22, 0.85)
        bright = clouded("bright", "#a9adb5", "#e8ebf0", 9, 0.2, 1.0)
        gold = clouded("gold", "#b07c22", "#f3cf70", 6, 0.22, 1.0)
        vertices, faces = box(1.5, 0.86, 0.16, 0.035, 4)
        Mesh("base", vertices + (0, 0, FLOOR + 0.08), faces, walnut(), rest=vertices, smooth=False, still=True)
        vertices, faces = box(1.24, 0.62, 0.06, 0.02, 3)
        Mesh("step", vertices + (0, 0, FLOOR + 0.19), faces, walnut(), rest=vertices + 3, smooth=False, still=True)
        for side in (-1, 1):
            for depth in (-0.16, 0.16):
                vertices, faces = lathe([(0, 0), (.07, 0), (.075, .03), (.045, .06), (.03, .10), (.028, .9), (.04, .93),
                                         (.028, .96), (.026, 1.68), (.05, 1.71), (.05, 1.74), (.02, 1.77), (.034, 1.81), (0, 1.845)], 32)
                Mesh(f"pillar {side} {depth}", vertices + (0.50 * side, depth, FLOOR + 0.22), faces, gold, rest=vertices, still=True)
        for name, height in (("lower", -0.62), ("upper", 0.84)):
            for depth in (-0.16, 0.16):
                vertices, faces = box(1.06, 0.035, 0.075, 0.012, 2)
                Mesh(f"{name} bar {depth}", vertices + (0, depth, height), faces, gold, rest=vertices, smooth=False, still=True)
        vertices, faces = box(0.06, 0.03, 1.5, 0.01, 2)
        Mesh("spine", vertices + (0, 0.16, 0.11), faces, gold, rest=vertices, smooth=False, still=True)

        # The train, from the great wheel up: each center stands where the pitch circles touch.
        radius = {teeth: TOOTH * teeth for teeth in (GREAT, CENTER, THIRD, ESCAPE)}
        great = np.array([-0.08, FACE, -0.22])
        center = great + (radius[GREAT] + radius[CENTER]) * direction(40)
        third = center + (radius[CENTER] + radius[THIRD]) * direction(110)
        escape = third + (radius[THIRD] + radius[ESCAPE]) * direction(176)
        self.wheels = []
        turns, phase, previous = 0.5, 0.0, None
        paints = [brass("great"), brass("center", "#8a8f98", "#dfe3ea", "#1f6fb4"), brass("third", "#a3562b", "#eaa06c", "#1d7a4c"),
                  brass("escape")]
        for teeth, at, material, spokes in zip((GREAT, CENTER, THIRD, ESCAPE), (great, center, third, escape), paints, (6, 4, 5, 4)):
            if previous is not None:
                old_teeth, old_at, old_phase, old_turns = previous
                turns = -old_turns * old_teeth / teeth
                # Where they touch, a tooth of one stands in a gap of the other.
                contact = math.atan2(at[2] - old_at[2], at[0] - old_at[0])
                share = (contact - old_phase) * old_teeth / TURN
                phase = contact + math.pi - (0.5 - share) * TURN / teeth
            vertices, faces = toothed(teeth, radius[teeth], 0.055, 0.03, spokes)
            wheel = Mesh(f"wheel {teeth}", vertices, faces, material, smooth=False)
            self.wheels.append((wheel, vertices, at, phase, turns))
            previous = (teeth, at, phase, turns)
            vertices, faces = tube(np.array([[at[0], -0.19, at[2]], [at[0], 0.19, at[2]]]), 0.018, 20)
            Mesh(f"arbor {teeth}", vertices, faces, bright, smooth=False, still=True)
            for depth in (-0.18, 0.18):
                vertices, faces = sphere(24, 12)
                Mesh(f"jewel {teeth} {depth}", vertices * (0.03, 0.016, 0.03) + (at[0], depth, at[2]), faces,
                     plain(f"ruby {teeth} {depth}", "#c01038", 0.1, coat=1.0), still=True)

        # The dial in front, with the hands.
        self.dial_at = np.array([0.0, -0.215, 0.30])
        ring, faces = lathe([(.235, -.012), (.365, -.012), (.37, 0), (.365, .012), (.235, .012), (.23, 0), (.235, -.012)], 120)
        ring = ring @ rotation((1, 0, 0), math.pi / 2).T
        Mesh("dial", ring + self.dial_at, faces, dial(), rest=ring, smooth=False, still=True)
        vertices, faces = sphere(32, 16)
        Mesh("hub", vertices * (0.035, 0.03, 0.035) + self.dial_at, faces, gold, rest=vertices, still=True)
        for side in (-1, 1):
            vertices, faces = tube(self.dial_at + np.array([[side * .365, .012, 0], [side * .50, .06, 0]]), 0.016, 16)
            Mesh(f"dial arm {side}", vertices, faces, gold, still=True)
        self.hands = []
        for name, length, width, turns in (("minute", 0.31, 0.020, 1.0), ("hour", 0.20, 0.030, 1 / 12)):
            stem, stem_faces = box(length + 0.06, 0.012, width, 0.005, 2)
            tip, tip_faces = lathe([(0, -.006), (width * 1.5, -.006), (width * 1.5, .006), (0, .006)], 32)
            tip = tip @ rotation((1, 0, 0), math.pi / 2).T + (length * 0.72, 0, 0)
            vertices, faces = joined((stem + (length / 2 - 0.03, 0, 0), stem_faces), (tip, tip_faces))
            vertices = vertices + (0, -0.022 if name == "minute" else -0.036, 0)
            self.hands.append((Mesh(f"{name} hand", vertices, faces, steel, smooth=False), vertices, turns))

        # The pendulum behind: rod, bob with rings, and the anchor above the escape wheel.
        self.pivot = np.array([0.0, 0.235, 0.80])
        rod = tube(np.array([[0, 0, 0.02], [0, 0, -1.12]]), 0.014, 16)
        bob, bob_faces = lathe([(0, -.055), (.08, -.05), (.15, -.025), (.17, 0), (.15, .025), (.08, .05), (0, .055)], 72)
        bob = bob @ rotation((1, 0, 0), -math.pi / 2).T
        paint = Paint("bob")
        x, _, z = paint.at().parts()
        distance = (x * x + z * z).root()
        star = distance + (z.angle(x) * 8.0).cosine() * 0.014
        shade = paint.mix(star.below(0.085, 0.002), color("#e3b756"), color("#a4202e"))
        shade = paint.mix(distance.below(0.045, 0.002), shade, color("#f6dc96"))
        shade = paint.mix(distance.between(0.125, 0.14, 0.002), shade, color("#7d4f14"))
        self.pendulum = [(Mesh("rod", *rod, bright), rod[0]),
                         (Mesh("bob", bob + (0, 0, -1.12), bob_faces, paint.surface(shade, 0.22, 0.7, coat=0.3), rest=bob), bob + (0, 0, -1.12))]
        anchor = box(0.34, 0.03, 0.05, 0.012, 2)
        pallets = [box(0.035, 0.05, 0.10, 0.01, 2) for _ in range(2)]
        vertices, faces = joined(anchor, *[(part + (side * 0.15, 0, -0.05), part_faces) for side, (part, part_faces) in zip((-1, 1), pallets)])
        self.pendulum.append((Mesh("anchor", vertices + (0, 0.03, 0.03), faces, steel, smooth=False), vertices + (0, 0.03, 0.03)))
        vertices, faces = tube(self.pivot + np.array([[0, -0.08, 0], [0, 0.06, 0]]), 0.022, 20)
        Mesh("pivot", vertices, faces, gold, smooth=False, still=True)
        self.move(0.0)

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        for wheel, vertices, at, phase, turns in self.wheels:
            wheel.move(vertices @ rotation((0, 1, 0), -(phase + TURN * turns * time)).T + at)
        for hand, vertices, turns in self.hands:
            # Clockwise, from ten past ten.
            start = math.radians(30 if turns == 1.0 else 145)
            hand.move(vertices @ rotation((0, 1, 0), -(start - TURN * turns * time)).T + self.dial_at)
        swing = rotation((0, 1, 0), 0.27 * math.sin(TURN * 3 * time))
        for part, vertices in self.pendulum:
            part.move(vertices @ swing.T + self.pivot)
