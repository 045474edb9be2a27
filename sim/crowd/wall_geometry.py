"""Distances between people and walls, in buffers that are filled anew each step.

Index order [i, w]: person i, wall segment w. Vectors point from the wall's nearest point to i.
"""

import numpy as np

from serd_core.arrays import FloatArray


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
        np.clip(self._position, 0.0, self._length, out=self._clipped)
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
