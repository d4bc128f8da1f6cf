"""The bouncing balls on a plinth in a room, one of them a mirror, before two cameras side by side that are moved together."""

import math

import numpy as np

import bouncing
from kit import room
from kit.cameras import View, look_at, wandering
from kit.motion import rotation
from kit.shapes import box

FLOOR = -1.25
CENTER, TARGET = np.array([0.0, -3.75, 0.75]), (0, 0.1, 0.05)
# Half of the distance between the cameras, and the angle by which each looks toward the other's side.
APART, INWARD = 0.13, 0.035


class Scene:
    """See above."""

    layout = "nerfds"
    size = (320, 180)
    opening = math.radians(50)
    frames = 30
    samples = 8
    surroundings = room.WALLS

    def build(self):
        """Makes everything, at time 0."""
        room.build(FLOOR, table=(1.5, 0.85))
        self.balls = bouncing.Scene()
        self.balls.place(mirror=True)
        under = bouncing.TOP - .13
        room.thing("plinth", box(1.2, 1.2, under - FLOOR, .03, 3), (0, 0, (under + FLOOR) / 2),
                   room.matter("plinth", "#4a4e69", "#9a8c98", 5, .35), smooth=False)

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        self.balls.move(time)

    def views(self):
        """A way around a point before the balls, the left camera (0) before the right one (1)."""
        way = wandering(self.frames, 21, (0.65, 0.2, 0.25))
        views = []
        for frame in range(self.frames):
            middle = look_at(CENTER + way[frame], TARGET)
            for camera, side in enumerate((-1, 1)):
                matrix = middle.copy()
                matrix[:3, 3] += middle[:3, 0] * APART * side
                matrix[:3, :3] = rotation(middle[:3, 1], INWARD * side) @ middle[:3, :3]
                views.append(View(frame, camera, frame / (self.frames - 1), matrix))
        return views
