"""Sample routes of the recursive logit: P(a | k) = M[k, a] z_a / z_k, and 1 / z_k to end at k."""

from collections.abc import Sequence

import numpy as np

from serd_core.arrays import FloatArray, IntArray, int_array, require_generator, require_index
from serd_core.errors import SerdError
from serd_core.routes.network import RouteNetwork
from serd_core.routes.recursive_logit import route_values


def sample_routes(
    network: RouteNetwork,
    weights: FloatArray,
    origins: Sequence[int] | IntArray,
    destinations: Sequence[int] | IntArray,
    *,
    rng: np.random.Generator,
) -> list[list[int]]:
    """The links of one route per pair of origin and destination."""
    require_generator(rng)
    wanted = int_array("destinations", destinations, (None,))
    starts = int_array("origins", origins, (len(wanted),))
    require_index("origins", starts, network.n_links, "a link")
    goals, column = np.unique(wanted, return_inverse=True)
    values = route_values(network, weights, goals)
    utility = network.features @ np.asarray(weights, dtype=np.float64)
    first = np.searchsorted(network.from_link, np.arange(network.n_links + 1))
    exits = [set(network.exits_of(int(goal)).tolist()) for goal in goals]
    routes = []
    for origin, place in zip(starts.tolist(), column.tolist(), strict=True):
        value, link, route = values[:, place], int(origin), [int(origin)]
        if not np.isfinite(value[link]):
            raise SerdError(
                f"destination {goals[place]} must be reached from origin {origin}, but no turns"
                " lead there; choose another pair"
            )
        while True:
            turns = np.arange(first[link], first[link + 1])
            onward = np.exp(utility[turns] + value[network.to_link[turns]] - value[link])
            ends = float(np.exp(-value[link])) if link in exits[place] else 0.0
            level = rng.random() * (ends + onward.sum())
            if level < ends:
                break
            taken = int(np.searchsorted(ends + np.cumsum(onward), level, side="right"))
            link = int(network.to_link[turns[min(taken, len(turns) - 1)]])
            route.append(link)
        routes.append(route)
    return routes
