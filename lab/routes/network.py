"""Road networks as links and turns, and trips on them.

A state is a link, an action a turn (k, a) to the next link, with features x(a | k) of the turn. A
trip to destination d may end on the links that are exits of d. One network serves all destinations.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray, IntArray
from serd_core.checks import float_array, int_array, require_count, require_index
from serd_core.dynamics.transition_model import places_of
from serd_core.errors import SerdError
from serd_core.mdp.problem import unique_names


@dataclass(frozen=True, eq=False)
class RouteNetwork:
    """T turns between L links.

    from_link, to_link: (T,); features: (T, F) of each turn, named by feature_names.
    exits: (X, 2) pairs (link, destination) at which a trip may end, without a feature. None where
    destinations are links; a trip then may end on its destination.
    """

    n_links: int
    from_link: IntArray
    to_link: IntArray
    features: FloatArray
    feature_names: tuple[str, ...]
    exits: IntArray | None = None

    def __post_init__(self) -> None:
        require_count("n_links", self.n_links, 1, "the number of links")
        names = unique_names(self.feature_names)
        features = float_array("features", self.features, (None, len(names)))
        if not len(features):
            raise SerdError("features must be of at least one turn, got none; add a turn")
        ends = [int_array(name, getattr(self, name), (len(features),)) for name in _TURN]
        for name, links in zip(_TURN, ends, strict=True):
            require_index(name, links, self.n_links, "a link")
        key = ends[0] * self.n_links + ends[1]
        order = np.argsort(key, kind="stable")
        if (twice := np.flatnonzero(np.diff(key[order]) == 0)).size:
            turn = order[twice[0]]
            raise SerdError(
                f"turns must differ from each other, got the turn from link {ends[0][turn]} to link"
                f" {ends[1][turn]} twice; keep one"
            )
        if self.exits is None:
            exits = np.repeat(np.arange(self.n_links)[:, None], 2, axis=1)
        else:
            exits = int_array("exits", self.exits, (None, 2))
            require_index("exits", exits[:, :1], self.n_links, "a link")
        for name, value in zip(_TURN, ends, strict=True):
            object.__setattr__(self, name, value[order])
        object.__setattr__(self, "features", features[order])
        object.__setattr__(self, "feature_names", names)
        object.__setattr__(self, "exits", exits)

    @cached_property
    def _keys(self) -> IntArray:
        return np.asarray(self.from_link * self.n_links + self.to_link)

    def turns(self, from_link: IntArray, to_link: IntArray) -> IntArray:
        """(N,) turn of each pair of links, -1 where there is none."""
        place = places_of(from_link * self.n_links + to_link, self._keys)
        inside = (np.minimum(from_link, to_link) >= 0) & (to_link < self.n_links)
        return np.where(inside, place, -1)

    def exits_of(self, destination: int) -> IntArray:
        """Links on which a trip to the destination may end."""
        assert self.exits is not None
        return np.asarray(self.exits[self.exits[:, 1] == destination, 0])

    def matrix(self, numbers: FloatArray) -> scipy.sparse.csc_array:
        """(L, L) sparse matrix with a number per turn."""
        shape = (self.n_links, self.n_links)
        return scipy.sparse.csc_array((numbers, (self.from_link, self.to_link)), shape=shape)


_TURN = ("from_link", "to_link")


@dataclass(frozen=True, eq=False)
class Trips:
    """N trips on a network.

    origin: (N,) first links; destinations: (D,) distinct ones; to: (N,) which each trip goes to.
    features: (N, F) sums of the features of the turns taken.
    """

    origin: IntArray
    destinations: IntArray
    to: IntArray
    features: FloatArray

    def __len__(self) -> int:
        return len(self.origin)


def trips_on(
    network: RouteNetwork,
    destination: Sequence[int] | IntArray,
    links: Iterable[Sequence[int] | IntArray],
) -> Trips:
    """Trips given by (N,) destinations and the sequence of links of each, the last an exit."""
    paths = [int_array(f"links of trip {n}", path, (None,)) for n, path in enumerate(links)]
    goals = int_array("destination", destination, (len(paths),))
    if not paths or min(map(len, paths)) < 1:
        raise SerdError("trips must be at least one, of at least one link each; drop empty ones")
    found, to = np.unique(goals, return_inverse=True)
    exits = [set(network.exits_of(int(goal)).tolist()) for goal in found]
    features = np.zeros((len(paths), len(network.feature_names)))
    for number, path in enumerate(paths):
        turns = network.turns(path[:-1], path[1:])
        if (missing := np.flatnonzero(turns < 0)).size:
            at = int(missing[0])
            raise SerdError(
                f"trip {number} turns from link {path[at]} to link {path[at + 1]}, which the"
                " network has not; drop the trip or add the turn"
            )
        if int(path[-1]) not in exits[to[number]]:
            raise SerdError(
                f"trip {number} ends on link {path[-1]}, which is no exit of its destination"
                f" {goals[number]}; add the exit or drop the trip"
            )
        features[number] = network.features[turns].sum(axis=0)
    return Trips(np.array([path[0] for path in paths]), found, to, features)
