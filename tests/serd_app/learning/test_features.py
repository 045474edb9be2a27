"""Features take part where they are defined and vary; own ones are a line of a file."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from serd_app.demonstrations.decision_table import Place, save_learnable
from serd_app.journeys.learn import learn_from_table
from serd_app.learning.features import read_own_features, with_chosen_features
from serd_app.learning.settings import LearningSettings
from serd_bag.errors import FileError
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import FEATURE_NAMES, build_navigation_problem, with_dwell_times
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.models import require_timed
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.scenario import load_scenario
from tests.conftest import OUTCOMES

GRID = Grid((0.0, 0.0), 1.0, np.ones((7, 5), dtype=bool))
EAST = GRID.centers_m[:, 0]
FILE = """\
features:
  lawn: {polygon_m: [[1, 2], [4, 2], [4, 5], [1, 5]], value: 1}
  desk: {point_m: [0.5, 0.5]}
  floor: {raster: floor.yaml}
"""


def problem_of(own=None, flow=-1, wall_m=None):
    """A room without a flow of people whose goal is its northern row."""
    by_decisions = build_navigation_problem(
        grid=GRID,
        flow=np.full(GRID.n_states, flow),
        goal_states=np.arange(30, 35),
        wall_distance_m=np.minimum(EAST, 5 - EAST) if wall_m is None else wall_m,
        discount=0.97,
        own_features=own or {},
    )
    return with_dwell_times(by_decisions, patience_s=4.0, wait_s=1.0)


@pytest.fixture
def own_file(tmp_path):
    path = tmp_path / "features.yaml"
    path.write_text(FILE)
    Image.fromarray(np.tile(np.array([0, 128, 255, 255, 0], np.uint8), (7, 1))).save(
        tmp_path / "floor.png"
    )
    (tmp_path / "floor.yaml").write_text("{image: floor.png, resolution: 1.0, origin: [0, 0, 0]}")
    return path


@pytest.mark.parametrize(
    ("flow", "walls_seen", "own", "names", "left_out"),
    [
        (1, True, {}, FEATURE_NAMES, {}),
        (-1, True, {}, ("goal", "inverse_wall_distance"), {"social_norm": "no flow"}),
        (-1, False, {}, ("goal",), {"social_norm": "no flow", "inverse_wall_distance": "no walls"}),
        (-1, True, {"flat": 0 * EAST}, ("goal", "inverse_wall_distance"),
         {"social_norm": "no flow", "flat": "it is the same for all"}),
        (-1, True, {"east": EAST, "west": 3 - 2 * EAST}, ("goal", "inverse_wall_distance", "east"),
         {"social_norm": "no flow", "west": "it is another name of east"}),
    ],
)  # fmt: skip
def test_a_feature_takes_part_where_it_is_defined_varies_and_is_no_alias(
    flow, walls_seen, own, names, left_out
):
    found, why = with_chosen_features(problem_of(flow=flow), own, walls_seen=walls_seen)
    assert found.feature_names == tuple(names)
    assert found.features.shape[2] == len(names)
    assert why.keys() == left_out.keys()
    assert all(why[name].startswith(reason) for name, reason in left_out.items())


def test_walls_that_are_as_far_everywhere_have_no_feature():
    found, why = with_chosen_features(problem_of(wall_m=np.ones(35)), {}, walls_seen=True)
    assert found.feature_names == ("goal",)
    assert why["inverse_wall_distance"] == "it is the same for all decisions"


def test_polygons_points_and_rasters_have_values_at_the_middles_of_cells(own_file):
    own = read_own_features(own_file, GRID, FEATURE_NAMES)
    north = GRID.centers_m[:, 1]
    np.testing.assert_allclose(own["lawn"], (EAST > 1) & (EAST < 4) & (north > 2) & (north < 5))
    away_m = np.hypot(EAST - 0.5, north - 0.5)
    np.testing.assert_allclose(own["desk"], away_m / away_m.max())
    np.testing.assert_allclose(own["floor"], np.tile([1, 127 / 255, 0, 0, 1], 7), atol=1e-6)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("features: {a: {}}", "must have one of polygon_m, point_m and raster, got 0"),
        ("features: {a: {polygon_m: [[0, 0], [1, 1]]}}", "three corners or more, got 2"),
        ("features: {goal: {point_m: [0, 0]}}", "must not be named as the usual ones, got 'goal'"),
        ("features: {a: {raster: none.yaml}}", "none.yaml"),
        ("features: {a: {raster: floor.yaml}}", r"must cover all cells, it ends before \(5\.5, 0"),
    ],
)
def test_a_file_of_features_that_is_wrong_is_refused(own_file, text, sentence):
    own_file.write_text(text)
    wide = Grid((0.0, 0.0), 1.0, np.ones((7, 6), dtype=bool))
    with pytest.raises(FileError, match=sentence):
        read_own_features(own_file, wide, FEATURE_NAMES)


def test_a_lawn_that_people_avoid_is_learned_and_driven_around(tmp_path, own_file):
    own = {"lawn": read_own_features(own_file, GRID, FEATURE_NAMES)["lawn"]}
    problem, _ = with_chosen_features(problem_of(), own, walls_seen=False)
    model = require_timed(problem.mdp.transitions)
    truth = model.parameters_from(np.array(list(OUTCOMES.values())), 1.0, 5.0)
    expert = soft_policy(problem, np.array([3.0, -6.0]), model.local_probabilities(truth))
    decisions = sample_timed_decisions(
        problem.mdp, expert.probabilities, truth, np.eye(35)[2], n_episodes=8, n_steps=80,
        rng=np.random.default_rng(1),
    )  # fmt: skip
    table, file = tmp_path / "decisions.csv", tmp_path / "lawn.yaml"
    save_learnable(table, Place(GRID, 4.0, 1.0), replace(decisions, source="room"))
    file.write_text("\n".join(FILE.splitlines()[:2]))
    settings = LearningSettings(discount=0.97)
    learned = learn_from_table(table, tmp_path / "model.yaml", settings, features=file)
    features = {each.name: each for each in learned.outcome.model.features}
    assert learned.outcome.fit.feature_names == ("goal", "lawn")
    assert learned.outcome.fit.reward_weights[1] < -1.0
    (lawn,) = (each for each in learned.outcome.knowledge.weights if each.feature == "lawn")
    assert lawn.known_from == "choices"
    assert features["inverse_wall_distance"].left_out.startswith("no walls were seen")
    kept = load_scenario(str(tmp_path / "model.scenario.yaml"))
    strategy = load_strategy(str(learned.model), kept, "optimal")
    inside = strategy.problem.features[:, 0, 1] > 0
    path = strategy.problem.grid.states_at(strategy.intended_path_m(2))
    assert not inside[path].any()
