"""The dancer in a room, before eight cameras that stand on an arc. The one in the middle is for testing."""

import math

import numpy as np

import dancer
from kit import room
from kit.cameras import View, look_at

TARGET, DISTANCE = np.array([0, 0.25, -0.05]), 4.15
# Where cameras stand, in degrees to the right and upward.
CAMERAS = ((0, 12), (-30, 8), (-21, 17), (-10, 6), (-5, 20), (9, 5), (19, 16), (29, 9))


class Scene:
    """See above."""

    layout = "neu3d"
    size = (336, 252)
    opening = math.radians(58)
    frames = 30
    samples = 24
    surroundings = room.WALLS

    def build(self):
        """Makes everything, at time 0."""
        room.build(dancer.FLOOR)
        self.dancer = dancer.Scene()
        self.dancer.place()

    def move(self, time):
        """Sets everything that moves to a time from 0 to 1."""
        self.dancer.move(time)

    def views(self):
        """One jump of the dancer, seen by each camera at each time."""
        places = []
        for right, up in CAMERAS:
            turn, rise = math.radians(right), math.radians(up)
            direction = np.array([math.sin(turn) * math.cos(rise), -math.cos(turn) * math.cos(rise), math.sin(rise)])
            # They do not look at exactly the same point. The sine is of degrees, for points without an order.
            target = TARGET + 0.03 * np.array([math.sin(right), 0, math.cos(right)])
            places.append(look_at(TARGET + DISTANCE * direction, target))
        return [View(frame, camera, 0.5 * frame / (self.frames - 1), place)
                for frame in range(self.frames) for camera, place in enumerate(places)]
