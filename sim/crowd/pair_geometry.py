"""Distances between people and everybody around them, in buffers that are filled anew each step.

Index order [i, j]: i is the person pushed, j the body that pushes. Vectors point from j to i.
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
        two, so that they part. Nobody is near themselves: that distance is infinite.
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
