"""Recursive logit: enumerated routes, derivatives, convergence of the series, and recovery."""

import numpy as np
import pytest

import serd_core as sc
from lab.catalogue import experiment_named
from lab.experiments.running.experiment import Session
from lab.routes.network import RouteNetwork, trips_on
from lab.routes.recursive_logit import RouteLikelihood, fit_routes, route_values, sample_routes
from serd_sim.episodes.execution import Execution


def grid_network(side=4, seed=0):
    """Directed links between neighbours of a grid; turns with a time, a constant and u-turns."""
    nodes = [(r, c) for r in range(side) for c in range(side)]
    links = [
        (a, (a[0] + dr, a[1] + dc))
        for a in nodes
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0))
        if (a[0] + dr, a[1] + dc) in nodes
    ]
    time = np.random.default_rng(seed).uniform(0.5, 1.5, len(links))
    pairs = [(i, j) for i, (_, b) in enumerate(links) for j, (c, _) in enumerate(links) if b == c]
    first, second = np.array(pairs).T
    back = [links[i][0] == links[j][1] for i, j in pairs]
    features = np.stack([time[second], np.ones(len(pairs)), np.array(back, float)], axis=1)
    return RouteNetwork(len(links), first, second, features, ("time", "links", "u-turn"))


WEIGHTS = np.array([-1.0, -0.8, -2.0])


def simulated(n_trips=200, seed=1, n_goals=5):
    network, rng = grid_network(), np.random.default_rng(seed)
    goals = rng.choice(network.n_links, n_goals, replace=False)[rng.integers(n_goals, size=n_trips)]
    origins = rng.integers(network.n_links, size=n_trips)
    routes = sample_routes(network, WEIGHTS, origins, goals, rng=rng)
    return network, trips_on(network, goals, routes)


def test_without_cycles_probabilities_are_those_of_the_enumerated_routes():
    """0 -> {1, 2} -> 3, 1 -> 2: three routes."""
    turns = np.array([(0, 1), (0, 2), (1, 3), (2, 3), (1, 2)])
    cost = np.array([1.0, 2.0, 1.0, 0.5, 0.3])
    network = RouteNetwork(4, *turns.T, cost[:, None], ("cost",))
    routes = [[0, 1, 3], [0, 2, 3], [0, 1, 2, 3]]
    utilities = -1.5 * np.array([2.0, 2.5, 1.8])
    expected = utilities - np.log(np.sum(np.exp(utilities)))
    for route, log_probability in zip(routes, expected, strict=True):
        likelihood = RouteLikelihood(network, trips_on(network, [3], [route]))
        assert likelihood.evaluate(np.array([-1.5]))[0] == pytest.approx(log_probability, rel=1e-12)


def test_value_is_that_of_the_soft_mdp_whose_discount_goes_to_one():
    network = grid_network(3)
    goal, n_links = 7, network.n_links
    utility, rows = network.features @ WEIGHTS, []
    for link in range(n_links):
        turns = np.flatnonzero(network.from_link == link)
        steps = [(int(network.to_link[t]), float(utility[t])) for t in turns]
        steps += [(n_links, 0.0)] if link == goal else []
        rows += [(link, a, s, r) for a, (s, r) in enumerate(steps)]
    rows.append((n_links, 0, n_links, 0.0))
    state, action, following = np.array([row[:3] for row in rows]).T
    transitions = np.zeros((n_links + 1, 1 + int(action.max()), n_links + 1))
    features = np.zeros((*transitions.shape[:2], 1))
    transitions[state, action, following] = 1.0
    features[state, action, 0] = [row[3] for row in rows]
    problem = sc.from_transitions(transitions, features, discount=1.0 - 1e-9, terminal=[n_links])
    expected = sc.soft_policy(problem, [1.0]).value[:n_links]
    found = route_values(network, WEIGHTS, [goal])[:, 0]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_gradient_scores_and_hessian_are_those_of_differences():
    network, trips = simulated(50)
    likelihood, step = RouteLikelihood(network, trips), 1e-5
    _, gradient = likelihood.evaluate(WEIGHTS)
    hessian = likelihood.hessian(WEIGHTS)
    np.testing.assert_allclose(likelihood.scores(WEIGHTS).sum(axis=0), gradient, atol=1e-9)
    for f in range(3):
        unit = step * np.eye(3)[f]
        above, below = likelihood.evaluate(WEIGHTS + unit), likelihood.evaluate(WEIGHTS - unit)
        assert (above[0] - below[0]) / (2 * step) == pytest.approx(gradient[f], rel=1e-6, abs=1e-6)
        np.testing.assert_allclose(
            (above[1] - below[1]) / (2 * step), hessian[f], rtol=1e-6, atol=1e-5
        )
    assert np.all(np.linalg.eigvalsh(hessian) < 0)


@pytest.mark.parametrize("seed", range(3))
def test_the_series_converges_where_the_spectral_radius_is_below_one(seed):
    """Random networks with weights just below and above the limit."""
    rng = np.random.default_rng(seed)
    pairs = np.argwhere(rng.random((12, 12)) < 0.3)
    network = RouteNetwork(12, *pairs.T, np.ones((len(pairs), 1)), ("links",))
    radius = np.max(np.abs(np.linalg.eigvals(network.matrix(np.ones(len(pairs))).toarray())))
    limit = -np.log(radius)
    assert np.all(np.isfinite(route_values(network, [limit - 1e-3], [0])[0]))
    with pytest.raises(sc.SerdError, match=r"but the spectral radius of .* is 1 or more at"):
        route_values(network, [limit + 1e-3], [0])


def test_weights_are_recovered_with_their_errors_from_many_destinations():
    away = []
    for seed in range(12):
        fit = fit_routes(*simulated(400, seed))
        assert fit.converged
        away.append((fit.weights - WEIGHTS) / fit.standard_errors)
        np.testing.assert_allclose(fit.robust_errors, fit.standard_errors, rtol=0.3)
    assert np.all(np.abs(np.mean(away, axis=0)) < 3 / np.sqrt(12))
    assert np.all(np.sum(np.square(away), axis=0) < 30)  # chi-squared of 12: 0.998


def write(folder, name, rows):
    (folder / name).write_text("".join(f"{r + 1} {c + 1} {v}\n" for r, c, v in rows))


def test_the_weights_that_made_trips_are_found_from_files_of_the_public_format(tmp_path):
    """Links of a grid with places at two of them, turns of random angles, and 300 trips.

    Left turns begin at 30 degrees: -0.53 is one, -0.51 is none.
    """
    weights, rng = np.array([-2.0, -0.5, -0.9, -3.0]), np.random.default_rng(0)
    grid = grid_network()
    pairs = np.stack([grid.from_link, grid.to_link], axis=1)
    angle = rng.choice([0.0, -0.51, -0.53, -1.5, np.pi], len(pairs)).round(4)
    time = rng.uniform(0.2, 1.0, grid.n_links).round(6)[grid.to_link]
    features = np.stack([time, np.ones(len(pairs)), angle < -0.52, angle > 3], axis=1)
    exits = [(0, grid.n_links), (grid.n_links - 1, grid.n_links + 1)]
    network = RouteNetwork(grid.n_links, *pairs.T, features, ("t", "c", "l", "u"), exits)
    goals = grid.n_links + rng.integers(2, size=300)
    origins = rng.integers(grid.n_links, size=300)
    routes = sample_routes(network, weights, origins, goals, rng=rng)
    write(tmp_path, "linkIncidence.txt", [(*pair, 1) for pair in [*pairs, *exits]])
    for name, values in (("estimatedtime", time), ("turnangles", angle)):
        rows = [(*pair, value) for pair, value in zip(pairs, values, strict=True)]
        write(tmp_path, f"ATTRIBUTE{name}.txt", rows)
    trips = [[goal, *route, goal] for goal, route in zip(goals, routes, strict=True)]
    rows = [(n, p, number + 1) for n, trip in enumerate(trips) for p, number in enumerate(trip)]
    write(tmp_path, "observationsForEstim.txt", rows)
    experiment = experiment_named("routes")
    config = experiment.make_config({"data": str(tmp_path)})
    session = Session(tmp_path / "out", Execution(n_jobs=1), lambda *_: None)
    found = experiment.write(config, session).set_index("name")
    found = found.loc[["time", "link constant", "left turn", "u-turn"]]
    assert np.all(np.abs(found["estimate"] - weights) < 3.5 * found["error"])
    assert found["converged"].all()


SMALL = grid_network(2)
REJECTED = (
    (RouteNetwork, (2, [0], [2], np.ones((1, 1)), ("x",)), r"to_link\[0\] must be a link from 0"),
    (trips_on, (SMALL, [0], [[0, 0]]), "trip 0 turns from link 0 to link 0, which the network"),
    (trips_on, (SMALL, [1], [[0]]), "trip 0 ends on link 0, which is no exit of its"),
    (route_values, (SMALL, WEIGHTS, [0, 99]), r"destinations\[1\] must have an exit .* got 99"),
)


@pytest.mark.parametrize(("make", "given", "sentence"), REJECTED)
def test_wrong_networks_trips_and_weights_are_rejected_with_a_sentence(make, given, sentence):
    with pytest.raises(sc.SerdError, match=sentence):
        make(*given)
