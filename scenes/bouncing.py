"""Three balls that bounce, spin and are squashed where they land, on a tiled board."""

import math

import numpy as np

from kit.meshes import Mesh
from kit.motion import TURN, rotation, smooth
from kit.paint import Paint, color
from kit.shapes import box, lathe, sphere
from kit.studio import lamp, sky, sun

TOP = -0.62                       # of the board
TILE = 0.205
# Radius, bounces, height, then of the way around the middle: radius, phase, radians; then axis and turns of the spin,
# and the phase of the bounces.
BALLS = [
    (0.27, 3, 1.25, 0.42, 0.2, 1.0, (0.2, 1.0, 0.3), 1.5, 0.00),
    (0.23, 4, 0.85, 0.44, 2.3, 1.0, (1.0, 0.3, 0.2), -1.0, 0.35),
    (0.31, 2, 1.05, 0.40, 4.35, 0.9, (0.1, 0.4, 1.0), 0.8, 0.60),
]
CONTACT = 0.20                    # share of a bounce in which a ball touches the board


def board_paint():
    """Tiles of marble by turns light and dark, framed in wood."""
    paint = Paint("board")
    at = paint.at()
    x, y, z = at.parts()
    veins = paint.noise(at, 3.2, 6, 0.6, 0.8)
    grain = paint.noise(at, 14, 3, 0.55)
    light = veins.ramp([(0.3, color("#d9c7a2")), (0.5, color("#f0e6cf")), (0.62, color("#b99a6a"))])
    dark = veins.ramp([(0.3, color("#16324a")), (0.52, color("#2a6f8f")), (0.66, color("#0d1f33"))])
    tiles = paint.checks(at + (10.0, 10.0, 0.003), 1 / TILE, light, dark)
    from_middle = [abs(((axis + 10.0) * (1 / TILE)).fraction() - 0.5) for axis in (x, y)]
    grout = from_middle[0].larger(from_middle[1]).above(0.468, 0.012)
    tiles = paint.mix(grout, tiles, color("#4b4036"))
    wood = paint.bands(at * (1, 1, 6.0), 2.0, 6.0, 3.0, "Z").ramp([(0.2, color("#5a2f16")), (0.7, color("#a5673a"))])
    rim = abs(x).larger(abs(y)).above(0.745, 0.004)
    top = paint.mix(rim, tiles, paint.mix(grain, color("#6b3a1c"), color("#b9783f")))
    shade = paint.mix(z.above(TOP - 0.012, 0.004), wood, top)
    return paint.surface(shade, roughness=grain * 0.25 + 0.22, normal=paint.bump(grain * 0.25 - grout, 0.25, 0.01))


def beach_paint():
    """Six gores, white caps, and two lines around."""
    paint = Paint("beach ball")
    at = paint.at()
    x, y, z = at.parts()
    turn = y.angle(x) / TURN + 0.5
    gores = ("#e6332a", "#f7f3ea", "#1d71b8", "#f9d423", "#f7f3ea", "#13a05a")
    shade = turn.ramp([(number / 6, color(gore)) for number, gore in enumerate(gores)], steps=True)
    shade = paint.mix(abs(z).above(0.93, 0.01), shade, color("#f7f3ea"))
    shade = paint.mix(abs(z).between(0.40, 0.46, 0.01), shade, color("#22252b"))
    shade = paint.mix(paint.noise(at, 9, 4) * 0.28, shade, color("#3a2f2a"))
    return paint.surface(shade, roughness=0.22, coat=0.4)


def stone_paint():
    """Violet to yellow, with dark cracks."""
    paint = Paint("stone")
    at = paint.at()
    cloud = paint.noise(at, 2.6, 7, 0.62, 0.9)
    crack = paint.cells(at, 3.4, edges=True).below(0.06, 0.03)
    shade = cloud.ramp([(0.28, color("#5b1a6e")), (0.45, color("#c2407a")), (0.6, color("#f6a04d")), (0.75, color("#ffe9a8"))])
    shade = paint.mix(crack, shade, color("#1c1024"))
    return paint.surface(shade, roughness=0.45, normal=paint.bump(cloud - crack * 0.6, 0.5, 0.05))


def globe_paint(mirror=False):
    """Fields of green and gold, as a globe has. `mirror`: of polished metal."""
    paint = Paint("globe")
    at = paint.at()
    x, y, z = at.parts()
    around = (y.angle(x) / TURN + 0.5) * 12.0
    down = z.arcsine() / math.pi * 8.0
    golden = ((around.floor() + down.floor() + 40.0) % 2.0).above(0.5, 0.01)
    cloud = paint.noise(at, 7, 5)
    green = cloud.ramp([(0.35, color("#0b6e4f")), (0.65, color("#31c48d"))])
    gold = cloud.ramp([(0.35, color("#c9a227")), (0.65, color("#ffe08a"))])
    roughness, metal = (0.08, 1.0) if mirror else (cloud * 0.3 + 0.12, golden * 0.75)
    return paint.surface(paint.mix(golden, green, gold), roughness=roughness, metal=metal)


def bounce(time, bounces, height, radius, phase):
    """Height of the center above the board, and how much the ball is stretched upward."""
    share = (time * bounces + phase) % 1.0
    if share < CONTACT:
        stretch = 1 - 0.38 * math.sin(math.pi * share / CONTACT)
        return radius * stretch, stretch
    flight = (share - CONTACT) / (1 - CONTACT)
    ends = float(smooth(flight / 0.10) * smooth((1 - flight) / 0.10))
    stretch = 1 + 0.16 * abs(1 - 2 * flight) * ends
    return radius * stretch + 4 * height * flight * (1 - flight), stretch


class Scene:
    """See above."""

    seed = 1
    samples = 48

    def build(self):
        """Makes everything, at time 0."""
        sky(strength=0.75)
        sun("key", (38, 12, 35), 2.6, (1.0, 0.95, 0.88), 6)
        lamp("fill", (-3.0, 2.5, 2.5), (0, 0, 0), 2.0, 60, (0.75, 0.85, 1.0))
        self.place()

    def place(self, mirror=False):
        """Makes everything but the light. `mirror`: the third ball is one."""
        vertices, faces = box(1.64, 1.64, 0.13, 0.02, 3)
        Mesh("board", vertices + (0, 0, TOP - 0.065), faces, board_paint(), smooth=False, still=True)
        vertices, faces = lathe([(0, TOP), (0.035, TOP), (0.045, TOP + .02), (0.03, TOP + 0.05), (0.05, TOP + .085),
                                 (0.03, TOP + .12), (0, TOP + .13)], 32)
        for number, (x, y) in enumerate([(-1, -1), (1, -1), (1, 1), (-1, 1)]):
            brass = Paint(f"brass {number}").surface(color("#d8a848"), 0.25, 1.0)
            Mesh(f"post {number}", vertices + (0.78 * 0.97 * x, 0.78 * 0.97 * y, 0), faces, brass, still=True)
        self.sphere, faces = sphere(112, 56)
        self.balls = [Mesh(f"ball {number}", self.sphere * 0.999, faces, paint)
                      for number, paint in enumerate((beach_paint(), stone_paint(), globe_paint(mirror)))]

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        for ball, (radius, bounces, height, reach, start, way, axis, turns, phase) in zip(self.balls, BALLS):
            above, stretch = bounce(time, bounces, height, radius, phase)
            angle = start + way * (time - 0.5)
            center = np.array([reach * math.cos(angle), reach * math.sin(angle), TOP + above])
            # As much thinner as it is higher, and squashed in the world's axes, however it has turned.
            across = 1 / math.sqrt(stretch)
            squash = np.array([across * radius, across * radius, stretch * radius])
            ball.move((self.sphere @ rotation(axis, TURN * turns * time).T) * squash + center)
