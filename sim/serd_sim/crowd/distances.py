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
        np.subtract(x_m[:n_people, None], x_m[None, :], out=self.dx_m)
        np.subtract(y_m[:n_people, None], y_m[None, :], out=self.dy_m)
        if self._period_m > 0.0:
            self.dx_m -= np.rint(self.dx_m / self._period_m) * self._period_m
        _lengths(self.dx_m, self.dy_m, self.distance_m)
        near = self.distance_m < _COINCIDENT_M
        if np.count_nonzero(near) > n_people:
            self.dx_m[near] = self._separation_m[near]
            _lengths(self.dx_m, self.dy_m, self.distance_m)
        self.distance_m[self._own] = np.inf


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
        np.subtract(x_m[:, None], self.start_m[0], out=self.dx_m)
        np.subtract(y_m[:, None], self.start_m[1], out=self.dy_m)
        position = self.dx_m * self.unit[0]
        position += self.dy_m * self.unit[1]
        # np.clip takes as long as ten of these for so few numbers.
        clipped = np.minimum(np.maximum(position, 0.0), self.length_m)
        np.equal(position, clipped, out=self.share, casting="unsafe")
        self.share += 1.0
        self.share *= 0.5
        self.dx_m -= clipped * self.unit[0]
        self.dy_m -= clipped * self.unit[1]
        _lengths(self.dx_m, self.dy_m, self.distance_m)


def _lengths(dx_m: FloatArray, dy_m: FloatArray, out: FloatArray) -> None:
    """Write the lengths of vectors into a buffer."""
    np.multiply(dx_m, dx_m, out=out)
    out += dy_m * dy_m
    np.sqrt(out, out=out)
