"""Tracked people of `pedestrians` beside the true ones at the same time."""

from collections import deque

import numpy as np
from sensor_msgs.msg import PointCloud2

from lab.benchmarks.driving.tracker import Sightings
from serd_ros.convert.sensors import from_people_message
from serd_ros.endpoints import qos


class HeardSightings(Sightings):
    """robot_at, people_at: (2,) place of the robot and the people at a stamp (ns), None as long as
    they are not known."""

    def __init__(self, probe, robot_at, people_at):
        super().__init__()
        self._robot_at, self._people_at = robot_at, people_at
        self._waiting = deque(maxlen=100)
        probe.node.create_subscription(PointCloud2, "pedestrians", self._take, qos.STATE)

    def __str__(self):
        errors_m = self.errors_m or [np.nan]
        return (
            f"{len(self.errors_m)} sightings, error median {np.median(errors_m):.3f} m, 95 %"
            f" {np.quantile(errors_m, 0.95):.3f} m, missed {self.missed_share:.3f}, nobody"
            f" {self.nobody_share:.3f} of {self.n_tracks} tracks"
        )

    def _take(self, message):
        self._waiting.append(from_people_message(message))
        for _ in range(len(self._waiting)):
            time_ns, tracked = self._waiting.popleft()
            robot_m, people = self._robot_at(time_ns), self._people_at(time_ns)
            if robot_m is None or people is None:
                self._waiting.append((time_ns, tracked))
            else:
                self.compare(robot_m, people, tracked)
