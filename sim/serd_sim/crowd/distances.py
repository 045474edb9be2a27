"""Distances of people to other people and to walls, in buffers that are filled anew each step.

Index order: [i, j] person i and body j, which pushes i; [i, w] person i and wall segment w. Vectors
point from the body, or from the wall's nearest point, to the person.
"""

import numpy as np

from serd_core.arrays import FloatArray

_COINCIDENT_M = 1e-6


class PairGeometry:
    """Buffers (n_people, n_bodies); the first n_people bodies are the people themselves.

    period_m: length after which the world repeats in x (a ring corridor), 0 for a plain world.
    """

    def __init__(self, n_people: int, n_bodies: int, period_m: float = 0.0) -> None:
        shape = (n_people, n_bodies)
        self.dx_m, self.dy_m = np.empty(shape), np.empty(shape)
        self.distance_m = np.empty(shape)
        self._period_m = period_m
        self._own = (np.arange(n_people), np.arange(n_people))
        rank = np.arange(n_people)[:, None] - np.arange(n_bodies)[None, :]
        self._separation_m = _COINCIDENT_M * np.sign(rank)

    def update(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Fill the buffers for bodies at (n_bodies,) positions.

        Two bodies at one point are taken to be a micrometre apart, in opposite directions for the
        two, so that they part. The distance of a person to themselves is infinite.
        """
        n_people = len(self.dx_m)
        measure_pairs(x_m, y_m, self._period_m, self.dx_m, self.dy_m, self.distance_m)
        near = self.distance_m < _COINCIDENT_M
        if np.count_nonzero(near) > n_people:
            self.dx_m[near] = self._separation_m[near]
            self.distance_m[:] = np.sqrt(self.dx_m * self.dx_m + self.dy_m * self.dy_m)
        self.distance_m[self._own] = np.inf


def measure_pairs(
    x_m: FloatArray,
    y_m: FloatArray,
    period_m: float,
    dx_m: FloatArray,
    dy_m: FloatArray,
    distance_m: FloatArray,
) -> None:
    """Fill the buffers for bodies at (n_bodies,) positions; period_m: 0 for a plain world."""
    n_people = len(dx_m)
    np.subtract(x_m[:n_people, None], x_m[None, :], out=dx_m)
    np.subtract(y_m[:n_people, None], y_m[None, :], out=dy_m)
    if period_m > 0.0:
        dx_m -= np.rint(dx_m / period_m) * period_m
    np.multiply(dx_m, dx_m, out=distance_m)
    distance_m += dy_m * dy_m
    np.sqrt(distance_m, out=distance_m)


class WallGeometry:
    """Buffers (n_people, W) for segments (W, 2, 2).

    share: 1 beside a wall, 1/2 beyond its end, so that a corner two walls share counts once.
    start_m, unit: (2, W) starts and directions of the walls; length_m: (W,).
    """

    def __init__(self, n_people: int, segments_m: FloatArray) -> None:
        start, along = segments_m[:, 0], segments_m[:, 1] - segments_m[:, 0]
        length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
        self.start_m, self.unit, self.length_m = start.T.copy(), along.T / length, length
        shape = (n_people, len(segments_m))
        self.dx_m, self.dy_m = np.empty(shape), np.empty(shape)
        self.distance_m, self.share = np.empty(shape), np.empty(shape)

    def update(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Fill the buffers for people at (n_people,) positions."""
        lines = self.start_m, self.unit, self.length_m
        measure_walls(x_m, y_m, *lines, self.dx_m, self.dy_m, self.distance_m, self.share)


def measure_walls(
    x_m: FloatArray,
    y_m: FloatArray,
    start_m: FloatArray,
    unit: FloatArray,
    length_m: FloatArray,
    dx_m: FloatArray,
    dy_m: FloatArray,
    distance_m: FloatArray,
    share: FloatArray,
) -> None:
    """Fill the buffers for people at (n_people,) positions; start_m, unit: (2, W)."""
    np.subtract(x_m[:, None], start_m[0], out=dx_m)
    np.subtract(y_m[:, None], start_m[1], out=dy_m)
    position = dx_m * unit[0]
    position += dy_m * unit[1]
    # np.clip takes as long as ten of these for so few numbers.
    clipped = np.minimum(np.maximum(position, 0.0), length_m)
    np.equal(position, clipped, out=share, casting="unsafe")
    share += 1.0
    share *= 0.5
    dx_m -= clipped * unit[0]
    dy_m -= clipped * unit[1]
    np.multiply(dx_m, dx_m, out=distance_m)
    distance_m += dy_m * dy_m
    np.sqrt(distance_m, out=distance_m)
