"""Compiled functions of a control period have the results of their twins in NumPy."""

import pickle
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.compiled import HAS_NUMBA, numba_loads
from sim import compiled
from sim.compiled import COMPILABLE, TickCount, use_compiled
from sim.drivers.expert import ScriptedExpert
from sim.episodes.episode import run_episode
from sim.planning.catalogue import make_planner
from sim.scenario.scenario import load_scenario
from sim.world.world import HallwayWorld

needs_numba = pytest.mark.skipif(not HAS_NUMBA, reason="numba (the extra `fast`) is not installed")


@pytest.fixture(autouse=True)
def _in_use(monkeypatch):
    """Compiled functions that a test uses are not used by later ones."""
    monkeypatch.setattr(compiled, "_in_use", {})


def walls(rng, n_walls):
    """(2, W) starts, (2, W) directions and (W,) lengths; some walls are parallel to an axis."""
    start_m = rng.uniform(-3.0, 3.0, (2, n_walls)).round(1)
    angle = rng.choice([0.0, 0.5 * np.pi, 1.0, 4.0], n_walls)
    return start_m, np.array([np.cos(angle), np.sin(angle)]), rng.uniform(0.0, 5.0, n_walls)


def vectors(rng, n_people, n_bodies):
    """x, y and length of (n_people, n_bodies) vectors; that of a person to themselves is inf."""
    dx, dy = rng.normal(0.0, 2.0, (2, n_people, n_bodies)).round(1)
    distance = np.sqrt(dx * dx + dy * dy) + 0.01
    distance[np.arange(n_people), np.arange(n_people)] = np.inf
    return dx, dy, distance


def arguments_of(rng):
    """Of every compiled function: arguments of random sizes, rounded so that limits are met."""
    n, k, t = int(rng.integers(1, 6)), int(rng.integers(0, 5)), int(rng.integers(1, 16))
    n_soon = int(rng.integers(0, t + 1))
    x, y = rng.uniform(-4.0, 8.0, (2, n, 3, t)).round(1)
    people = rng.uniform(-4.0, 8.0, (2, k, t)).round(1)
    now = people[:, :, :1].copy()
    bodies = rng.normal(0.0, 1.0, (6, n + k)).round(1)
    buffers = np.zeros((3, n, n + k))
    pairs = rng.uniform(0.0, 5.0, (2, n + k)).round(1)
    lines = walls(rng, k)
    rays = np.cos(np.linspace(0.0, 7.0, 40)), np.sin(np.linspace(0.0, 7.0, 40))
    pushes = vectors(rng, n, n + k)
    to_robot = pushes[0][:, -1].copy(), pushes[1][:, -1].copy(), pushes[2][:, -1].copy()
    yield "measure_pairs", (*pairs, float(rng.choice([0.0, 3.0])), *buffers)
    yield "measure_walls", (*pairs[:, :n].copy(), *lines, *np.zeros((4, n, k)))
    yield "predicted_repulsion", (*pushes, *bodies, (0.6, 0.2, 0.06, 0.3, 1e-9, 1e-3))
    yield (
        "headings_past",
        (*to_robot, *bodies[:3, :n].copy(), (0.5, -0.25), 0.7, 2.0, (*lines, 0.25)),
    )
    yield (
        "headings_on_legs",
        (*pairs[:, :n].copy(), rng.normal(0.0, 2.0, (5, n)).round(1), 5.0, 0.6),
    )
    crowd = rng.normal(0.0, 2.0, (int(rng.integers(0, 30)), 2)).round(0)
    velocity = np.where(rng.random(crowd.shape) < 0.1, np.nan, rng.normal(size=crowd.shape))
    yield "predicted", (crowd, velocity, 0.0, 0.5, 3.5, int(rng.integers(1, 9)), x[0, 0].copy())
    yield "total_force", (2.0, *bodies)
    yield "walk", (*rng.normal(size=(6, n)), rng.uniform(0.5, 2.0, n), 0.05)
    yield "range_to_lines", (*pairs[:, :k].copy(), bodies[:2, :k].T.copy(), *rays)
    yield "range_to_circles", (*pairs[:, :k].copy(), 0.0625, *rays)
    yield "nearest_wall", (rng.normal(size=(30, 40)), x, y, (-1.0, -2.0), 5.0, 0.25, n_soon)
    yield "distance_to_nearest", (x, y, *people)
    yield "distance_to_nearest", (x[0, 0, :1], y[0, 0, :1], *people)
    yield "nearest_person", (x, y, *people, 0.5, x[0, 0, :n_soon].copy(), 0.25)
    yield "nearest_person", (x[:1, 0], y[:1, 0], *people, 0.5, x[0, 1, :n_soon].copy(), 0.25)
    yield "nearest_now", (x[..., :1], y[..., :1], *now, 0.5, 0.25, np.array([0.125]))
    yield "largest_product", (x, y[0, 0].copy())
    yield "any_before", (x[..., :n_soon] > 5.0, y[..., :n_soon] > 5.0, x[:, :1, :n_soon] > 0.0)
    yield "any_before", (x[:, 0, :n_soon] > 5.0, y[:, 0, :n_soon] > 5.0, x[:, 1, :n_soon] > 0.0)
    yield "shortest_so_far", (x, y, 1.0, 2.0)
    yield "shortest_so_far", (x[:, 0], y[:, 0], 1.0, 2.0)
    yield "ramp", (0.25, bodies[0], 1.5, np.arange(1, t + 1) * 0.1)
    yield "positions", (0.5, x[:, 0].copy(), y[0], 0.1)


def results_of(function, arguments):
    """What a function returns, and the arguments, which it may fill."""
    own = tuple(each.copy() if isinstance(each, np.ndarray) else each for each in arguments)
    returned = function(*own)
    returned = returned if isinstance(returned, tuple) else (returned,)
    return [each for each in (*returned, *own) if isinstance(each, np.ndarray)]


@needs_numba
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_every_compiled_function_has_the_results_of_numpy(seed):
    from sim.compiled_loops import COMPILED

    names = set()
    for name, arguments in arguments_of(np.random.default_rng(seed)):
        names.add(name)
        expected = results_of(COMPILABLE[name], arguments)
        found = results_of(COMPILED[name], arguments)
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            assert (one.shape, one.dtype) == (other.shape, other.dtype), name
            np.testing.assert_array_equal(one, other, err_msg=name)
    assert names == set(COMPILED) == set(COMPILABLE)


def trajectory(name, planner, **robot):
    """What is observed and commanded in an episode of 12 s, and the last scan."""
    scenario = load_scenario(name).with_pedestrian_count(30)
    settings_ = scenario.robot.model_copy(update=robot)
    scenario = scenario.model_copy(update={"robot": settings_})
    seen = []

    def keep(observation, command, action):
        people = observation.people_position_m.ravel()
        motion = observation.speed_mps, observation.yaw_rate_radps
        command = command.linear_mps, command.angular_radps
        seen.append([*observation.pose, *motion, *people, *command, int(action)])

    with HallwayWorld(scenario, seed=3) as world:
        driver = ScriptedExpert(scenario, 3)
        planner = make_planner(planner, scenario)
        run_episode(world, planner, driver, episode=0, timeout_s=12.0, observer=keep)
        return np.array(seen), world.scan()


@needs_numba
@pytest.mark.parametrize(
    ("name", "planner", "drive"),
    [("hallway", "dwa", "physical"), ("crossing", "mppi", "kinematic")],
)
def test_a_trajectory_does_not_depend_on_what_is_compiled(name, planner, drive):
    expected = trajectory(name, planner, drive=drive)
    assert use_compiled()
    found = trajectory(name, planner, drive=drive)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@needs_numba
def test_a_planner_that_is_given_no_number_stays_within_its_raster():
    """Without numbers every cell of the raster would be beyond its end in compiled code."""
    from sim.compiled_loops import COMPILED

    table = np.arange(12.0).reshape(3, 4)
    for nowhere, found in ((np.nan, 0.0), (-np.inf, 0.0), (np.inf, 11.0), (1e300, 11.0)):
        place = np.full((2, 5), nowhere)
        nearest, _ = COMPILED["nearest_wall"](table, place, place, (0.0, 0.0), 20.0, 0.5, 5)
        assert nearest.tolist() == [found, found]


@needs_numba
def test_compiled_functions_are_used_from_many_ticks_on(monkeypatch):
    monkeypatch.setattr(compiled, "MANY_TICKS", 100)
    driven = TickCount()
    driven.add(99)
    assert not compiled._in_use
    driven.add(1)
    assert set(compiled._in_use) == set(COMPILABLE)


@pytest.fixture
def loads_again():
    """What was found out about numba is forgotten before and after the test."""
    for each in (numba_loads, compiled._compiled_functions):
        each.cache_clear()
    yield
    for each in (numba_loads, compiled._compiled_functions):
        each.cache_clear()


@pytest.mark.usefixtures("loads_again")
def test_without_numba_nothing_is_compiled(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    assert not use_compiled()


@needs_numba
@pytest.mark.usefixtures("loads_again")
def test_where_numba_compiles_nothing_its_functions_are_not_used(monkeypatch):
    monkeypatch.setattr("numba.config.DISABLE_JIT", 1)
    assert not use_compiled()


@needs_numba
@pytest.mark.usefixtures("loads_again")
def test_where_numba_finds_no_folder_for_its_files_nothing_is_compiled(monkeypatch):
    refusals = []

    def refuse(**_):
        refusals.append("refused")
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.delitem(sys.modules, "sim.compiled_loops", raising=False)
    monkeypatch.delattr("sim.compiled_loops", raising=False)
    monkeypatch.setattr("numba.njit", refuse)
    monkeypatch.setattr(compiled, "MANY_TICKS", 1)
    driven = TickCount()
    for _ in range(5):
        driven.add(1)
    assert not use_compiled()
    assert refusals == ["refused"]


@pytest.mark.parametrize(
    "error",
    [OSError(28, "No space left on device"), EOFError(), pickle.UnpicklingError("truncated")],
)
def test_on_a_full_disk_or_with_damaged_files_the_functions_are_those_of_numpy(error):
    def fail(*_):
        raise error

    expected = trajectory("hallway", "dwa", drive="kinematic")
    compiled._in_use.update(dict.fromkeys(COMPILABLE, fail))
    found = trajectory("hallway", "dwa", drive="kinematic")
    assert not compiled._in_use
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
