"""Pairs of people near each other, and of each person and the robot, found anew as people move.

Few people are all paired. Among many those within reach are found by a k-d tree, with a margin, and
found again once somebody may have crossed half of it: the cost of a step grows with the number of
people, not with its square. Pairs come in blocks whose memory serves one step after another.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray

_COINCIDENT_M = 1e-6
#: Up to so many people are all paired.
_FEW = 60
#: Margin (m) of the reach, which spares a search in most steps.
_MARGIN_M = 0.5
#: Pairs of a block: arrays of more, together, are returned to the system and mapped anew each time.
_BLOCK = 6_000


@dataclass(frozen=True, eq=False)
class Pairs:
    """(n,) arrays: `body` pushes `person`; vectors point from the body to the person.

    Of n_people people; the body of that number is the robot, which is that of the first n_robot.
    """

    n_people: int
    n_robot: int
    person: IntArray
    body: IntArray
    dx_m: FloatArray
    dy_m: FloatArray
    distance_m: FloatArray

    def totals(self, values: FloatArray) -> FloatArray:
        """(n_people,) sums of the values (n,) of each person's pairs."""
        return np.asarray(np.bincount(self.person, values, self.n_people), dtype=np.float64)


class Neighbours:
    """Finds the pairs of a crowd.

    reach_m: distance up to which people push each other. period_m: length after which the world
    repeats in x (a ring corridor), 0 for a plain world.
    """

    def __init__(self, n_people: int, reach_m: float, period_m: float = 0.0) -> None:
        self._n_people, self._reach_m, self._period_m = n_people, reach_m, period_m
        self._found_at: FloatArray | None = None
        first, second = np.triu_indices(n_people if n_people <= _FEW else 0, 1)
        self._set(first, second)

    def _set(self, first: IntArray, second: IntArray) -> None:
        """Take pairs of people; each of the two is pushed, and all by the robot."""
        people = np.arange(self._n_people)
        self._person = np.concatenate([people, first, second])
        self._body = np.concatenate([np.full_like(people, self._n_people), second, first])

    def blocks(self, x_m: FloatArray, y_m: FloatArray) -> Iterator[Pairs]:
        """The pairs of bodies at (n_people + 1,) places, the robot last.

        Two bodies at one point are taken to be a micrometre apart, in opposite directions for the
        two, so that they part.
        """
        if self._n_people > _FEW:
            self._search(np.stack([x_m[:-1], y_m[:-1]], axis=1))
        for begin in range(0, len(self._person), _BLOCK):
            rows = slice(begin, begin + _BLOCK)
            person, body = self._person[rows], self._body[rows]
            dx_m, dy_m = self._apart(x_m[person] - x_m[body]), y_m[person] - y_m[body]
            distance_m = np.sqrt(dx_m * dx_m + dy_m * dy_m)
            if distance_m.min(initial=np.inf) < _COINCIDENT_M:
                near = distance_m < _COINCIDENT_M
                dx_m[near] = _COINCIDENT_M * np.sign(person - body)[near]
                distance_m = np.hypot(dx_m, dy_m)
            n_robot = max(self._n_people - begin, 0)
            yield Pairs(self._n_people, n_robot, person, body, dx_m, dy_m, distance_m)

    def _apart(self, dx_m: FloatArray) -> FloatArray:
        """Differences of x, the shorter way round a ring."""
        if self._period_m > 0.0:
            dx_m -= np.rint(dx_m / self._period_m) * self._period_m
        return dx_m

    def _search(self, places: FloatArray) -> None:
        """Find the pairs again where people may have left the margin."""
        if self._found_at is not None:
            moved = places - self._found_at
            moved[:, 0] = self._apart(moved[:, 0])
            if (moved * moved).sum(axis=1).max() < (0.5 * _MARGIN_M) ** 2:
                return
        from scipy.spatial import cKDTree  # here, for it takes 0.2 s of every node's start

        box, on_ring = None, places.copy()
        if self._period_m > 0.0:
            box = [self._period_m, 0.0]
            on_ring[on_ring[:, 0] >= self._period_m, 0] = 0.0  # rounded up by the modulus
        pairs = cKDTree(on_ring, boxsize=box).query_pairs(
            self._reach_m + _MARGIN_M, output_type="ndarray"
        )
        self._found_at = places
        self._set(pairs[:, 0], pairs[:, 1])
