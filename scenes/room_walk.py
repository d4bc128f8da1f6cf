"""The flag, the gears and the knot in a room, before one camera that is moved by hand."""

import math

import numpy as np

import flag
from kit import room
from kit.cameras import View, look_at, wandering

CENTER, TARGET = np.array([0.0, -3.55, 0.45]), np.array([0.0, 0.1, 0.02])


class Scene:
    """See above."""

    layout = "hypernerf"
    size = (270, 480)
    opening = math.radians(38)
    frames = 60
    samples = 6
    surroundings = room.WALLS

    def build(self):
        """Makes everything, at time 0."""
        room.build(flag.BASE - .09, height=4.6, rug=False, table=(1.25, 0.95))
        self.flag = flag.Scene()
        self.flag.place()

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        self.flag.move(time)

    def views(self):
        """A way around a point before the flag. The camera shakes and tilts a little."""
        way = wandering(self.frames, 11, (0.62, 0.2, 0.28))
        shake = wandering(self.frames, 12, (0.06, 0.06, 0.05), (1.3, 2.9, 4.1))
        views = []
        for frame in range(self.frames):
            up = np.array([0.03 * math.sin(5 * frame / self.frames), 0, 1])
            views.append(View(frame, 0, frame / (self.frames - 1), look_at(CENTER + way[frame], TARGET + shake[frame], up)))
        return views
