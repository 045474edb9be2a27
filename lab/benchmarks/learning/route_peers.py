"""Route choice without a discount against irl-maxent, in one run: `route_peers`.

300 trips to one of 64 links of a grid on a torus, where every link has three turns: the weights of
the minutes and of the number of links. A trip ends on its destination. Times are processor times.
"""

import tempfile
from pathlib import Path

import numpy as np

from lab.benchmarks.learning.learning_peers import compare_weights
from lab.benchmarks.report import save
from lab.routes.network import RouteNetwork, trips_on
from lab.routes.recursive_logit import fit_routes, sample_routes
from serd_core.arrays import FloatArray

SIDE, N_TRIPS = 4, 300
WEIGHTS, START = np.array([-1.0, -1.5]), np.array([0.0, -2.0])
#: Needs the fewest steps among 0.02, 0.05, 0.1 and 0.2; with 0.4 irl-maxent does not end.
LEARNING_RATE = 0.2


def run() -> None:
    """Compare; the peer is installed on the first run."""
    network, goals = torus(SIDE), np.zeros(N_TRIPS, dtype=int)
    rng = np.random.default_rng(0)
    origins = rng.integers(1, network.n_links, size=N_TRIPS)
    routes = sample_routes(network, WEIGHTS, origins, goals, rng=rng)
    trips = trips_on(network, goals, routes)

    def fit() -> FloatArray:
        return fit_routes(network, trips, initial_weights=START).weights

    peers = {"irl-maxent": ("irl_maxent", "irl_maxent_fit.py", str(LEARNING_RATE))}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "routes.npz"
        _write(file, network, routes)
        rows = compare_weights("routes", fit, peers, file)
    save("route_peers", "Route choice without a discount against irl-maxent", rows)


def torus(side: int) -> RouteNetwork:
    """Four links from each of side x side nodes, and three turns from each link but link 0.

    Features are those of the link that is left, so that a state table has them too.
    """
    steps = ((1, 0), (0, 1), (-1, 0), (0, -1))
    links = [(x, y, d) for x in range(side) for y in range(side) for d in range(4)]
    number = {link: n for n, link in enumerate(links)}
    turns = []
    for (x, y, d), n in number.items():
        ahead = (x + steps[d][0]) % side, (y + steps[d][1]) % side
        turns += [(n, number[(*ahead, to)]) for to in range(4) if n > 0 and to != (d + 2) % 4]
    minutes = np.random.default_rng(1).uniform(-1.0, 1.0, len(links))
    left, to = np.array(turns).T
    features = np.stack([minutes[left], np.ones(len(left))], axis=1)
    return RouteNetwork(len(links), left, to, features, ("minutes", "links"))


def _write(file: Path, network: RouteNetwork, routes: list[list[int]]) -> None:
    place = np.arange(len(network.from_link)) % 3
    transitions = np.zeros((network.n_links, network.n_links, 3))
    transitions[network.from_link, network.to_link, place] = 1.0
    features = np.zeros((network.n_links, 2))
    features[network.from_link] = network.features
    links, lengths = np.concatenate(routes), list(map(len, routes))
    np.savez(
        file, transitions=transitions, features=features, links=links, lengths=lengths, goal=0,
        initial_weights=START,
    )  # fmt: skip
