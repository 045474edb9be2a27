"""Distances of people to other people and to walls, in buffers that are filled anew each step.

Index order: [i, j] person i and body j, which pushes i; [i, w] person i and wall segment w. Vectors
point from the body, or from the wall's nearest point, to the person.
"""

import numpy as np

from serd_core.arrays import FloatArray

_COINCIDENT_M = 1e-6


class PairGeometry:
    """Buffers (n_people, n_bodies); the first n_people bodies are the people themselves.

    period_m: length after which the world repeats in x (a ring corridor), None for a plain world.
    """

    def __init__(self, n_people: int, n_bodies: int, period_m: float | None = None) -> None:
        shape = (n_people, n_bodies)
        self.dx_m, self.dy_m = np.empty(shape), np.empty(shape)
        self.distance_m, self._scratch = np.empty(shape), np.empty(shape)
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
        if self._period_m is not None:
            np.divide(self.dx_m, self._period_m, out=self._scratch)
            np.rint(self._scratch, out=self._scratch)
            self._scratch *= self._period_m
            self.dx_m -= self._scratch
        self._measure()
        if np.count_nonzero(self.distance_m < _COINCIDENT_M) > n_people:
            near = self.distance_m < _COINCIDENT_M
            self.dx_m[near] = self._separation_m[near]
            self._measure()
        self.distance_m[self._own] = np.inf

    def _measure(self) -> None:
        np.multiply(self.dx_m, self.dx_m, out=self.distance_m)
        np.multiply(self.dy_m, self.dy_m, out=self._scratch)
        self.distance_m += self._scratch
        np.sqrt(self.distance_m, out=self.distance_m)


class WallGeometry:
    """Buffers (n_people, W) for segments (W, 2, 2).

    share: 1 beside a wall, 1/2 beyond its end, so that a corner two walls share counts once.
    """

    def __init__(self, n_people: int, segments_m: FloatArray) -> None:
        start, along = segments_m[:, 0], segments_m[:, 1] - segments_m[:, 0]
        length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
        self._start_x, self._start_y = start[:, 0].copy(), start[:, 1].copy()
        self._unit_x, self._unit_y = along[:, 0] / length, along[:, 1] / length
        self._length = length
        shape = (n_people, len(segments_m))
        self.dx_m, self.dy_m = np.empty(shape), np.empty(shape)
        self.distance_m, self.share = np.empty(shape), np.empty(shape)
        self._position, self._clipped = np.empty(shape), np.empty(shape)

    def update(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Fill the buffers for people at (n_people,) positions."""
        np.subtract(x_m[:, None], self._start_x, out=self.dx_m)
        np.subtract(y_m[:, None], self._start_y, out=self.dy_m)
        np.multiply(self.dx_m, self._unit_x, out=self._position)
        np.multiply(self.dy_m, self._unit_y, out=self._clipped)
        self._position += self._clipped
        # np.clip takes as long as ten of these for so few numbers.
        np.maximum(self._position, 0.0, out=self._clipped)
        np.minimum(self._clipped, self._length, out=self._clipped)
        np.equal(self._position, self._clipped, out=self.share, casting="unsafe")
        self.share += 1.0
        self.share *= 0.5
        np.multiply(self._clipped, self._unit_x, out=self._position)
        self.dx_m -= self._position
        np.multiply(self._clipped, self._unit_y, out=self._position)
        self.dy_m -= self._position
        np.multiply(self.dx_m, self.dx_m, out=self.distance_m)
        np.multiply(self.dy_m, self.dy_m, out=self._position)
        self.distance_m += self._position
        np.sqrt(self.distance_m, out=self.distance_m)
