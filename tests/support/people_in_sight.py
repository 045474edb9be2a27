"""Tracked people of `pedestrians` beside the true ones at the same time.

A person counts while within 5 m of the robot with no other body on the line to the centre. A track
within 0.4 m of a person is that person's; a track without a person within 0.4 m is nobody.
"""

from collections import deque

import numpy as np
from sensor_msgs.msg import PointCloud2

from serd_ros.convert.sensors import from_people_message
from serd_ros.endpoints import qos

BODY_M, REACH_M, MATCH_M = 0.25, 5.0, 0.4


def in_sight(robot_m, people_m):
    """(N,) who is within reach, with no other body on the line from the robot to the centre."""
    place_m = people_m - robot_m
    away_m = np.hypot(*place_m.T)
    seen = away_m < REACH_M
    for person in np.flatnonzero(seen):
        ahead = place_m[person] / away_m[person]
        along_m, aside_m = place_m @ ahead, np.abs(place_m @ np.array([-ahead[1], ahead[0]]))
        hides = (along_m > 0) & (along_m < away_m[person]) & (aside_m < BODY_M)
        hides[person] = False
        seen[person] = not hides.any()
    return seen


class Sightings:
    """Errors of the tracks of people in sight; how many have none, and how many are nobody."""

    def __init__(self):
        self.errors_m = []
        self.errors_mps = []
        self.n_missed = self.n_tracks = self.n_nobody = 0

    def compare(self, robot_m, true, tracked):
        """Take the people and the tracks at one time."""
        away_m = np.linalg.norm(true.position_m[:, None] - tracked.position_m[None], axis=2)
        for person in np.flatnonzero(in_sight(robot_m, true.position_m)):
            if away_m[person].min(initial=np.inf) >= MATCH_M:
                self.n_missed += 1
                continue
            track = away_m[person].argmin()
            error_mps = true.velocity_mps[person] - tracked.velocity_mps[track]
            self.errors_m.append(away_m[person, track])
            self.errors_mps.append(np.hypot(*error_mps))
        near = np.hypot(*(tracked.position_m - robot_m).T) < REACH_M
        self.n_tracks += int(near.sum())
        self.n_nobody += int((away_m.min(axis=0, initial=np.inf)[near] >= MATCH_M).sum())

    @property
    def missed_share(self):
        """Share of the people in sight without a track."""
        return self.n_missed / max(self.n_missed + len(self.errors_m), 1)

    @property
    def nobody_share(self):
        """Share of the tracks within reach that are nobody."""
        return self.n_nobody / max(self.n_tracks, 1)


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
