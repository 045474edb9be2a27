"""Distances of people to other people and to walls, filled anew each step.

Index order: [i, j] person i and body j, which pushes i; [i, w] person i and wall segment w. Vectors
point from the body, or from the wall's nearest point, to the person.
"""

import numpy as np

from serd_core.arrays import FloatArray

_COINCIDENT_M = 1e-6


class PairGeometry:
    """dx_m, dy_m, distance_m: (n_people, n_bodies); the first n_people bodies are the people.

    period_m: length after which the world repeats in x (a ring corridor), 0 for a plain world.
    """

    def __init__(self, n_people: int, n_bodies: int, period_m: float = 0.0) -> None:
        self._period_m = period_m
        self._own = (np.arange(n_people), np.arange(n_people))
        rank = np.arange(n_people)[:, None] - np.arange(n_bodies)[None, :]
        self._separation_m = _COINCIDENT_M * np.sign(rank)

    def update(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Take bodies at (n_bodies,) positions.

        Two bodies at one point are taken to be a micrometre apart, in opposite directions for the
        two, so that they part. The distance of a person to themselves is infinite.
        """
        n_people = len(self._separation_m)
        self.dx_m, self.dy_m = x_m[:n_people, None] - x_m, y_m[:n_people, None] - y_m
        if self._period_m > 0.0:
            self.dx_m -= np.rint(self.dx_m / self._period_m) * self._period_m
        self.distance_m = _lengths(self.dx_m, self.dy_m)
        near = self.distance_m < _COINCIDENT_M
        if np.count_nonzero(near) > n_people:
            self.dx_m[near] = self._separation_m[near]
            self.distance_m = _lengths(self.dx_m, self.dy_m)
        self.distance_m[self._own] = np.inf


class WallGeometry:
    """dx_m, dy_m, distance_m, share: (n_people, W) for segments (W, 2, 2).

    share: 1 beside a wall, 1/2 beyond its end, so that a corner two walls share counts once.
    start_m, unit: (2, W) starts and directions of the walls; length_m: (W,).
    """

    def __init__(self, segments_m: FloatArray) -> None:
        start, along = segments_m[:, 0], segments_m[:, 1] - segments_m[:, 0]
        self.length_m = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
        self.start_m, self.unit = start.T.copy(), along.T / self.length_m

    def update(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Take people at (n_people,) positions."""
        dx_m, dy_m = x_m[:, None] - self.start_m[0], y_m[:, None] - self.start_m[1]
        position = dx_m * self.unit[0] + dy_m * self.unit[1]
        # np.clip takes as long as ten of these for so few numbers.
        clipped = np.minimum(np.maximum(position, 0.0), self.length_m)
        self.share = 0.5 * (1.0 + (position == clipped))
        self.dx_m, self.dy_m = dx_m - clipped * self.unit[0], dy_m - clipped * self.unit[1]
        self.distance_m = _lengths(self.dx_m, self.dy_m)

    def nearest_m(self, x_m: float, y_m: float) -> float:
        """Take a single body at a place; its distance to the nearest wall."""
        self.update(np.array([x_m]), np.array([y_m]))
        return float(self.distance_m.min())


def _lengths(dx_m: FloatArray, dy_m: FloatArray) -> FloatArray:
    lengths: FloatArray = np.sqrt(dx_m * dx_m + dy_m * dy_m)
    return lengths
