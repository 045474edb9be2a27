"""Route choice from files: the public format gives the network, and its trips the weights."""

import numpy as np
import pytest

from lab.catalogue import experiment_named
from lab.experiments.running.experiment import Session
from lab.routes.network import RouteNetwork
from lab.routes.recursive_logit import sample_routes
from serd_sim.episodes.execution import Execution

WEIGHTS = np.array([-2.0, -0.5, -0.9, -3.0])  # time, constant, left turn, u-turn


def write(folder, name, rows):
    (folder / name).write_text("".join(f"{r + 1} {c + 1} {v}\n" for r, c, v in rows))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Links of a 4 x 4 grid with a place at each of two corners, and 300 trips to the places."""
    here, side = tmp_path_factory.mktemp("routes"), 4
    steps = [1, 1j, -1, -1j]
    nodes = {complex(x, y) for x in range(side) for y in range(side)}
    links = [(a, a + d) for a in sorted(nodes, key=lambda z: (z.real, z.imag)) for d in steps]
    links = [link for link in links if link[1] in nodes]
    rng = np.random.default_rng(0)
    time = rng.uniform(0.2, 1.0, len(links)).round(6)
    pairs = [(i, j) for i, a in enumerate(links) for j, b in enumerate(links) if a[1] == b[0]]
    angle = {
        (i, j): -np.angle((links[j][1] - links[j][0]) / (links[i][1] - links[i][0]))
        for i, j in pairs
    }
    ends = [(i, len(links) + p) for p, n in enumerate((0, 3 + 3j)) for i, a in enumerate(links)]
    ends = [(i, p) for (i, p) in ends if links[i][1] == (0, 3 + 3j)[p - len(links)]]
    write(here, "linkIncidence.txt", [(*pair, 1) for pair in [*pairs, *ends]])
    write(here, "ATTRIBUTEestimatedtime.txt", [(i, j, time[j]) for i, j in pairs])
    write(here, "ATTRIBUTEturnangles.txt", [(*pair, angle[pair]) for pair in pairs])
    degrees = np.degrees([angle[pair] for pair in pairs])
    features = [
        [time[j], 1.0, -177 < turned <= -40, abs(turned) >= 177]
        for (_, j), turned in zip(pairs, degrees, strict=True)
    ]
    network = RouteNetwork(
        len(links), *np.array(pairs).T, np.array(features, float), ("t", "c", "l", "u"), ends
    )
    goals = len(links) + rng.integers(2, size=300)
    routes = sample_routes(network, WEIGHTS, rng.integers(len(links), size=300), goals, rng=rng)
    numbers = [[goal, *route, goal] for goal, route in zip(goals, routes, strict=True)]
    rows = [(n, p, number + 1) for n, trip in enumerate(numbers) for p, number in enumerate(trip)]
    write(here, "observationsForEstim.txt", rows)
    return here


def test_the_weights_that_made_the_trips_are_found(folder, tmp_path):
    experiment = experiment_named("routes")
    config = experiment.make_config({"data": str(folder)})
    table = experiment.write(config, Session(tmp_path, Execution(n_jobs=1), lambda *_: None))
    found = table.set_index("name")
    names = ["time", "link constant", "left turn", "u-turn"]
    away = (found.loc[names, "estimate"] - WEIGHTS) / found.loc[names, "error"]
    assert np.all(np.abs(away) < 3.5)
    assert found["converged"].all()
