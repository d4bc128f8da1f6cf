"""A dancer on a round stage: she jumps and swings her arms, and her skirt flares and stays outside her legs."""

import math

import numpy as np

from kit.bodies import Skeleton, blended, capsule, grown
from kit.meshes import Mesh
from kit.motion import TURN, applied, rotation
from kit.paint import Paint, color
from kit.shapes import grid_faces, lathe
from kit.studio import lamp, sky, sun

FLOOR = -1.10
SIDES = ((1, "left"), (-1, "right"))
BONES = {
    "pelvis": (None, (0, 0, -0.02), (0, 0, 0.16), 0.15),
    "chest": ("pelvis", (0, 0, 0.20), (0, 0, 0.46), 0.16),
    "neck": ("chest", (0, 0, 0.52), (0, 0, 0.64), 0.07),
    "head": ("neck", (0, 0, 0.66), (0, -0.01, 0.86), 0.15),
}
for side, of in SIDES:
    BONES[f"{of} upper arm"] = ("chest", (.185 * side, 0, .50), (.44 * side, 0, .50), 0.065)
    BONES[f"{of} forearm"] = (f"{of} upper arm", (.44 * side, 0, .50), (.67 * side, 0, .50), 0.055)
    BONES[f"{of} hand"] = (f"{of} forearm", (.68 * side, 0, .50), (.78 * side, 0, .50), 0.05)
    BONES[f"{of} thigh"] = ("pelvis", (.105 * side, 0, -.06), (.12 * side, 0, -.50), 0.10)
    BONES[f"{of} shin"] = (f"{of} thigh", (.12 * side, 0, -.50), (.125 * side, .01, -.93), 0.075)
    BONES[f"{of} foot"] = (f"{of} shin", (.125 * side, .0, -.97), (.13 * side, -.13, -1.01), 0.05)
# Radii of the legs at head and tail of a bone, as the skirt meets them.
LEGS = {"thigh": (.125, .09), "shin": (.09, .065)}
AROUND, DOWN = 120, 26            # of the skirt


def body(points):
    """Distance to trunk, arms and legs."""
    distance = capsule(points, (0, 0, 0.0), (0, 0, .20), .150, .128, 1.25)

    def add(start, end, start_radius, end_radius, blend, flatness=1.0):
        nonlocal distance
        distance = blended(distance, capsule(points, start, end, start_radius, end_radius, flatness), blend)

    add((0, 0, .26), (0, 0, .43), .135, .165, .06, 1.35)
    add((-.15, 0, .49), (.15, 0, .49), .075, .075, .06)
    add((0, 0, .50), (0, 0, .66), .062, .058, .04)
    for side, _ in SIDES:
        add((.17 * side, 0, .50), (.44 * side, 0, .50), .072, .055, .04)
        add((.44 * side, 0, .50), (.68 * side, 0, .50), .056, .040, .02)
        add((.69 * side, 0, .50), (.765 * side, 0, .50), .046, .036, .02, 1.1)
        add((.70 * side, -.02, .50), (.735 * side, -.07, .50), .02, .016, .015)
        add((.095 * side, 0, -.03), (.12 * side, 0, -.50), .115, .072, .045)
        add((.12 * side, 0, -.50), (.125 * side, .01, -.95), .073, .047, .02)
        add((.125 * side, .035, -1.0), (.13 * side, -.14, -1.02), .062, .052, .03)
    return distance


def head(points):
    """Distance to skull, jaw, nose and ears."""
    distance = capsule(points, (0, 0.005, .74), (0, .0, .82), .135, .155)
    distance = blended(distance, capsule(points, (0, -.05, .70), (0, -.06, .72), .085, .085), .05)
    distance = blended(distance, capsule(points, (0, -.155, .765), (0, -.165, .745), .012, .022), .02)
    for side, _ in SIDES:
        distance = blended(distance, capsule(points, (.152 * side, .01, .78), (.158 * side, .01, .75), .025, .02), .012)
    return distance


def hair(points):
    """Distance to a cap of hair, open at the face, with a tuft."""
    distance = capsule(points, (0, .03, .80), (0, .02, .84), .158, .165)
    face = capsule(points, (0, -.20, .70), (0, -.17, .81), .15, .125)
    distance = -blended(-distance, face, .03)
    for lock in range(14):
        turn = TURN * lock / 14
        tip = (.05 * math.cos(turn), .10 + .05 * math.sin(turn), 1.0 + .01 * math.cos(3 * turn))
        distance = blended(distance, capsule(points, (0, .09, .94), tip, .05, .035), .02)
    return distance


def skin(paint):
    """The color of skin."""
    return paint.noise(paint.at(), 9, 3).ramp([(0.3, color("#b97a56")), (0.7, color("#d9a47c"))])


def body_paint():
    """A striped shirt with a star, checked leggings, socks, shoes and gloves."""
    paint = Paint("body")
    at = paint.at()
    x, y, z = at.parts()
    out = abs(x)
    fine = paint.noise(at, 18, 4)
    stripe = TURN / 0.075
    upright = (z * stripe).sine().above(0.0, 0.12)
    along_arm = (out * stripe).sine().above(0.0, 0.12)
    stripes = paint.mix(out.above(0.185, 0.004), paint.vector(upright, upright, upright), paint.vector(along_arm, along_arm, along_arm))
    shirt = paint.mix(stripes, color("#f2efe6"), color("#1f3a93"))
    up = z - 0.34
    star = (x * x + up * up).root() + (x.angle(up) * 5.0).cosine() * -0.018
    front = y.below(-0.02, 0.002)
    shirt = paint.mix(front * star.below(0.080, 0.003), shirt, color("#f9c80e"))
    shirt = paint.mix(front * star.below(0.052, 0.003), shirt, color("#ea3546"))
    rows = (z * (1 / 0.06) * math.pi).sine().above(0.2, 0.2)
    columns = (y.angle(out - 0.118) * 1.6 * math.pi).sine().above(0.2, 0.2)
    leggings = paint.mix(rows, color("#234d20"), color("#5b8c2a"))
    leggings = paint.mix(columns * 0.6, leggings, color("#c9df8a"))
    shoe = paint.mix(fine.above(0.5, 0.05), color("#c1121f"), color("#e63946"))
    shoe = paint.mix(z.above(-1.045, 0.004), color("#f4f4f4"), shoe)
    shade = paint.mix(z.above(0.03, 0.003), leggings, shirt)
    shade = paint.mix(z.below(-0.86, 0.003), shade, color("#ffffff"))
    shade = paint.mix(z.below(-0.945, 0.003), shade, shoe)
    upper = z.above(0.2)
    bare = (out.above(0.36, 0.002) * upper).larger(z.above(0.565, 0.002))
    shade = paint.mix(bare, shade, skin(paint))
    shade = paint.mix(out.between(0.335, 0.362, 0.002) * upper, shade, color("#ea3546"))
    knit = paint.mix((out * 180.0).sine().above(0.0, 0.2), color("#6a0dad"), color("#8e44ec"))
    shade = paint.mix(out.above(0.665, 0.002) * upper, shade, knit)
    shade = paint.mix(z.between(0.02, 0.06, 0.002) * out.below(0.3), shade, color("#3b2314"))
    return paint.surface(shade, roughness=0.55, sheen=0.2, normal=paint.bump(fine, 0.12, 0.004))


def head_paint():
    """A face, painted on the front."""
    paint = Paint("head")
    x, y, z = paint.at().parts()
    out = abs(x)
    front = y.below(-0.06, 0.005)

    def disc(across, up, width, height):
        right, above = (out - across) * (1 / width), (z - up) * (1 / height)
        return front * (right * right + above * above).below(1.0, 0.08)

    shade = paint.mix(disc(0.085, 0.735, .035, .028) * 0.6, skin(paint), color("#e0705a"))
    shade = paint.mix(disc(0.055, 0.795, .026, .020), shade, color("#fdfdfd"))
    shade = paint.mix(disc(0.053, 0.795, .013, .015), shade, color("#2d6a4f"))
    shade = paint.mix(disc(0.053, 0.795, .007, .008), shade, color("#0a0a0a"))
    shade = paint.mix(disc(0.056, 0.835, .028, .006), shade, color("#3a1d0c"))
    shade = paint.mix(disc(0.0, 0.690, .036, .011), shade, color("#a4161a"))
    return paint.surface(shade, roughness=0.45)


def hair_paint():
    """Brown locks."""
    paint = Paint("hair")
    locks = paint.bands(paint.at() * (1, 1, 0.5), 14.0, 5.0, 3.0, "X", 1.5)
    shade = locks.ramp([(0.1, color("#2b120a")), (0.6, color("#6b2f12")), (0.95, color("#b5651d"))])
    return paint.surface(shade, roughness=0.35, normal=paint.bump(locks, 0.5, 0.01))


def skirt_paint():
    """Zigzags in five colors, darker inside. Its coordinates are the turn and the share downward."""
    paint = Paint("skirt")
    at = paint.at()
    turn, down, _ = at.parts()
    zigzag = abs((turn * 14.0).fraction() - 0.5)
    rows = (down * 3.0 + zigzag * 0.9).fraction()
    shade = rows.ramp([(0.0, color("#d62246")), (0.22, color("#f6ae2d")), (0.44, color("#2a9d8f")), (0.66, color("#f1faee")),
                       (0.84, color("#4b1d52"))], steps=True)
    shade = paint.mix(down.above(0.955, 0.003), shade, color("#f6d365"))
    shade = paint.mix(paint.backside(), shade, paint.mix(0.6, shade, color("#5a1e3c")))
    weave = paint.noise(at * (60, 16, 1), 4, 3)
    return paint.surface(paint.mix(weave * 0.2, shade, color("#20121c")), roughness=0.6, sheen=0.3)


def stage_paint():
    """Planks, and a blue side."""
    paint = Paint("stage")
    at = paint.at()
    x, y, z = at.parts()
    plank = (x + 10.0) * (1 / 0.145)
    across = plank.fraction()
    gap = across.below(0.03, 0.015).larger(across.above(0.97, 0.015))
    grain = paint.noise(paint.vector(x * 22.0, y * 2.0, plank.floor() * 3.7), 1.0, 6, 0.6, 1.0)
    shade = grain.ramp([(0.3, color("#6f4420")), (0.5, color("#a86f3c")), (0.7, color("#d3a368"))])
    shade = paint.mix(gap, shade, color("#24140a"))
    blue = paint.noise(at, 12, 4).ramp([(.3, color("#2b2d42")), (.7, color("#565b8a"))])
    shade = paint.mix(z.below(FLOOR - 0.012, 0.003), shade, blue)
    return paint.surface(shade, roughness=0.32, normal=paint.bump(grain - gap, 0.15, 0.01))


def pose(time):
    """The rotation of each bone: two jumps, and one turn to either side."""
    beat = TURN * 2 * time
    yaw = TURN * time
    lifts = {"right": 0.5 - 0.5 * math.cos(beat), "left": 0.5 - 0.5 * math.cos(beat - 0.35)}
    turns = {
        "pelvis": rotation((0, 0, 1), 0.7 * math.sin(yaw)) @ rotation((0, 1, 0), 0.08 * math.sin(beat)),
        "chest": rotation((0, 0, 1), 0.35 * math.sin(yaw + 1.0)) @ rotation((0, 1, 0), -0.12 * math.sin(beat))
        @ rotation((1, 0, 0), 0.10 * math.sin(2 * beat)),
        "neck": rotation((0, 0, 1), -0.25 * math.sin(yaw + .6)),
        "head": rotation((0, 1, 0), 0.15 * math.sin(beat + .5)) @ rotation((1, 0, 0), 0.12 * math.sin(beat)),
    }
    for side, of in SIDES:
        lift = lifts[of]
        raised = math.radians(-68 + 128 * lift)
        turns[f"{of} upper arm"] = rotation((0, 1, 0), -side * raised) @ rotation((0, 0, 1), -side * 0.35 * math.sin(beat + 0.4))
        turns[f"{of} forearm"] = (rotation((0, 0, 1), -side * (0.35 + 0.5 * lift * (1 - lift) * 4 * 0.6))
                                  @ rotation((0, 1, 0), -side * 0.25 * math.sin(beat)))
        turns[f"{of} hand"] = rotation((0, 1, 0), -side * 0.35 * math.sin(beat + 1.2))
        apart = math.radians(3 + 19 * lift)
        kick = 0.35 * max(0.0, math.sin(beat + (0 if side > 0 else math.pi)))
        turns[f"{of} thigh"] = rotation((0, 1, 0), -side * apart) @ rotation((1, 0, 0), -kick)
        turns[f"{of} shin"] = rotation((1, 0, 0), 0.25 * (1 - lift) + 1.1 * kick)
        turns[f"{of} foot"] = rotation((0, 1, 0), side * apart * 0.8) @ rotation((1, 0, 0), 0.30 * abs(math.sin(beat)))
    return turns


class Scene:
    """See above."""

    seed = 3
    samples = 20

    def build(self):
        """Makes everything, at time 0."""
        sky((0.85, 0.88, 1.0), (0.32, 0.28, 0.26), 0.75)
        sun("key", (48, 6, 25), 2.4, (1.0, 0.96, 0.9), 7)
        lamp("fill", (-2.5, -3.0, 1.5), (0, 0, 0), 2.0, 60, (0.85, 0.9, 1.0))
        vertices, faces = lathe([(0, FLOOR - .07), (0.70, FLOOR - .07), (0.73, FLOOR - .06), (0.735, FLOOR - .012), (0.72, FLOOR), (0, FLOOR)], 96)
        Mesh("stage", vertices, faces, stage_paint(), smooth=False, still=True)
        self.place()

    def place(self):
        """Makes the dancer, at time 0."""
        self.skeleton = Skeleton(BONES)
        self.body, faces = grown(body, (-.85, -.26, -1.12), (.85, .2, .72), 0.012)
        self.weights = self.skeleton.weights(self.body, 0.28)
        # Nothing follows a limb of the other side.
        for index, name in enumerate(self.skeleton.names):
            if name.startswith("left"):
                self.weights[self.body[:, 0] < -0.03, index] = 0
            if name.startswith("right"):
                self.weights[self.body[:, 0] > 0.03, index] = 0
        self.weights /= self.weights.sum(1, keepdims=True)
        self.body_mesh = Mesh("body", self.body, faces, body_paint())
        self.head, faces = grown(head, (-.22, -.22, .56), (.22, .22, 1.04), 0.009)
        self.head_mesh = Mesh("head", self.head, faces, head_paint())
        self.hair, faces = grown(hair, (-.22, -.22, .56), (.22, .26, 1.12), 0.011)
        self.hair_mesh = Mesh("hair", self.hair, faces, hair_paint())
        self.around, self.down = np.meshgrid(np.linspace(0, 1, AROUND + 1), np.linspace(0, 1, DOWN), indexing="ij")
        rest = np.stack([self.around, self.down, 0 * self.around], -1).reshape(-1, 3)
        vertices = np.stack([np.cos(self.around), np.sin(self.around), -self.down], -1).reshape(-1, 3)
        self.skirt_mesh = Mesh("skirt", vertices, grid_faces(AROUND + 1, DOWN), skirt_paint(), rest=rest)

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        beat = TURN * 2 * time
        placed = self.skeleton.transforms(pose(time))
        bent = self.skeleton.bent(self.body, self.weights, placed)
        hop = 0.13 * max(0.0, math.sin(beat)) ** 2 + 0.10 * max(0.0, math.sin(beat + math.pi)) ** 2
        # The lowest point stands on the floor, but for the hop.
        at = np.array([0.05 * math.sin(TURN * time), 0.04 * math.sin(2 * TURN * time), FLOOR + hop - bent[:, 2].min()])
        self.body_mesh.move(bent + at)
        self.head_mesh.move(applied(placed["head"], self.head) + at)
        self.hair_mesh.move(applied(placed["head"], self.hair) + at)
        self.skirt_mesh.move(applied(placed["pelvis"], self._skirt(time, placed).reshape(-1, 3)) + at)

    def _skirt(self, time, placed):
        """The skirt in the axes of the pelvis, (around, down, 3)."""
        beat, yaw_rate = TURN * 2 * time, math.cos(TURN * time)
        turn, down = TURN * self.around, self.down
        # It lags behind the hips, and flares as they turn.
        lag = -0.30 * yaw_rate * down ** 1.5
        flare = 0.19 + 0.05 * abs(yaw_rate) + 0.06 * math.sin(beat + 0.9)
        radius = (0.165 + flare * down ** 1.15 + 0.024 * down * np.sin(10 * turn + 2.2 * math.sin(beat))
                  + 0.015 * down * np.sin(5 * turn - beat))
        waist = 1 / np.sqrt(np.cos(turn) ** 2 + (1.18 * np.sin(turn)) ** 2)
        reach = radius * (waist + (1 - waist) * down)
        height = 0.075 - 0.45 * down * (1 - 0.18 * math.sin(beat + 0.5)) + 0.012 * down * np.sin(7 * turn + beat)
        cloth = np.stack([reach * np.cos(turn + lag), reach * np.sin(turn + lag), height], -1)
        to_pelvis = np.linalg.inv(placed["pelvis"])
        legs = []
        for _, of in SIDES:
            for bone, radii in LEGS.items():
                _, head_at, tail_at, _ = BONES[f"{of} {bone}"]
                ends = applied(to_pelvis @ placed[f"{of} {bone}"], np.array([head_at, tail_at], float))
                legs.append((ends[0], ends[1], *radii))
        for _ in range(3):
            distance = np.min([capsule(cloth.reshape(-1, 3), *leg) for leg in legs], axis=0).reshape(turn.shape)
            push = np.clip(0.02 - distance, 0, None)
            # The first column and the last one are the same seam. Spread, so that a leg makes no dent of its own shape.
            push[-1] = push[0]
            for _ in range(6):
                ring = push[:-1]
                spread = (ring + np.roll(ring, 1, 0) + np.roll(ring, -1, 0)) / 3
                spread[:, 1:-1] = (spread[:, 1:-1] + spread[:, :-2] + spread[:, 2:]) / 3
                push[:-1] = np.maximum(spread, ring * 0.8)
                push[-1] = push[0]
            outward = np.hypot(cloth[..., 0], cloth[..., 1])[..., None]
            cloth[..., :2] += cloth[..., :2] / outward * push[..., None]
        return cloth
