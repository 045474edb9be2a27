"""Laws of dwell times of any fit: learned together, counted, of hidden actions, and by place."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.learning.recipe import LearningTask, learn, with_moves_as_actions
from serd_app.learning.settings import LearningSettings
from serd_core.demonstrations.decisions import HIDDEN, TimedDecisions
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Action, Grid, Outcome
from serd_core.grid.navigation import (
    MODEL_NAMES,
    WAITING,
    build_navigation_problem,
    with_dwell_times,
)
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.models import SemiMarkovModels, require_timed, semi_markov_problem
from serd_files.model_file import load_model
from serd_files.yaml_config import save_yaml_model
from serd_sim.drivers.strategy import dynamics_of_draws, learned_dynamics
from tests.conftest import OUTCOMES

#: A hallway of 3 by 9 cells: people walk south in the west, north in the east; the goal is north.
GRID = Grid((0.0, 0.0), 1.0, np.ones((9, 3), dtype=bool))
FLOW = np.tile([Action.SOUTH, -1, Action.NORTH], 9)
PATIENCE_S, WAIT_S = 4.0, 1.0
PROBLEM = with_dwell_times(
    build_navigation_problem(
        grid=GRID,
        flow=FLOW,
        goal_states=[24, 25, 26],
        wall_distance_m=np.tile([0.5, 1.5, 0.5], 9),
        discount=0.97,
    ),
    patience_s=PATIENCE_S,
    wait_s=WAIT_S,
)
MODEL = require_timed(PROBLEM.mdp.transitions)
TABLE = np.array(list(OUTCOMES.values()))
TRUTH = MODEL.parameters_from(TABLE, [1.0, 2.5, 1.4], 5.0)
TASK = LearningTask(PROBLEM, "")
WEIGHTS = np.array([3.0, 0.2, 0.0])


def demonstrations(n_episodes, seed=0, log_pace=None, believed=TRUTH):
    """Decisions of an expert who starts in the southern row."""
    problem = semi_markov_problem(PROBLEM, log_pace=log_pace)
    table = problem.mdp.transitions.local_probabilities(believed)
    starts = np.zeros(GRID.n_states)
    starts[:3] = 1 / 3
    return sample_timed_decisions(
        problem.mdp,
        soft_policy(problem, WEIGHTS, table).probabilities,
        TRUTH,
        starts,
        n_episodes=n_episodes,
        n_steps=60,
        rng=np.random.default_rng(seed),
        mean_until_command_s=8.0,
    )


@pytest.fixture(scope="module")
def decisions():
    return demonstrations(12)


def learned(decisions, method, **options):
    settings = LearningSettings(method=method, discount=0.97, prior_weights=(1.0,), **options)
    return learn(TASK, decisions, settings)


def means_of(outcome):
    return {row.name: row.mean_s for row in outcome.model.outcome_models}


def test_a_fit_by_evidence_has_the_true_means_within_its_intervals(decisions):
    found = learned(decisions, "mdce_serd_evidence")
    assert found.problem is PROBLEM
    assert found.fit.converged
    rows = {row.model: row for row in found.knowledge.durations}
    for model, true_s in zip(MODEL_NAMES, (1.0, 2.5, 1.4), strict=False):
        spread = np.log(rows[model].upper_s / rows[model].lower_s) / (2 * 1.645)
        assert abs(np.log(means_of(found)[model] / true_s)) < 4 * spread
    assert means_of(found)["waiting"] == WAIT_S
    assert len(found.durations) == 1
    assert "waiting" not in found.durations[0]


@pytest.mark.parametrize("method", ["mdce_irl", "mdce_serd_free"])
def test_other_methods_count_the_laws(decisions, method):
    found = learned(decisions, method)
    assert not isinstance(found.problem.mdp.transitions, SemiMarkovModels)
    counted = estimate_dynamics(PROBLEM, decisions)
    expected = np.exp(counted[MODEL.means]).tolist()
    assert [means_of(found)[name] for name in MODEL_NAMES[:3]] == pytest.approx(expected)
    believed = [each.believed_mean_s for each in found.model.outcome_models[:3]]
    assert believed == pytest.approx(expected)
    for each in found.model.draws.mean_s:
        assert each == pytest.approx(expected)


def test_hidden_actions_are_those_that_lead_to_the_next_cell_and_stays_are_left_out():
    # A move north, a stay at a wall, a known action, and a decision that was cut off.
    state, following = np.array([[4, 7], [0, 0], [4, 4], [5, 5]]).T
    given = TimedDecisions(
        np.zeros(4, int),
        np.arange(4.0),
        state,
        [HIDDEN, HIDDEN, int(Action.WEST), HIDDEN],
        following,
        dwell_s=[1.0, 4.0, 4.0, 0.5],
        censored=[False, False, False, True],
    )
    found = with_moves_as_actions(GRID, given)
    assert (found.state.tolist(), found.dwell_s.tolist()) == ([4, 4], [1.0, 4.0])
    assert found.action.tolist() == [Action.NORTH, Action.WEST]
    shown = given.select(np.array([2]))
    assert with_moves_as_actions(GRID, shown) is shown


def test_where_actions_are_hidden_laws_are_counted_from_moves_and_waits_stay(decisions):
    hidden = replace(decisions, action=np.full(len(decisions), HIDDEN))
    found = learned(hidden, "mdce_serd_evidence")
    assert not isinstance(found.problem.mdp.transitions, SemiMarkovModels)
    expected = estimate_dynamics(PROBLEM, with_moves_as_actions(GRID, hidden))
    laws = np.exp(expected[MODEL.means])
    assert [means_of(found)[name] for name in MODEL_NAMES[:3]] == pytest.approx(laws.tolist())
    draws = found.model.draws
    assert len(draws.mean_s) == len(draws.learned) > 10
    np.testing.assert_allclose(draws.mean_s, np.broadcast_to(laws, (len(draws.mean_s), 3)))
    stays = np.eye(len(Outcome))[Outcome.STAY]
    assert found.model.outcome_models[WAITING].learned == tuple(stays)
    for table in draws.learned:
        assert table[WAITING] == pytest.approx(stays)


def test_places_are_taken_where_left_out_episodes_support_them():
    log_pace = np.where(np.arange(GRID.n_states) // 3 % 2, np.log(3.0), 0.0)
    many = demonstrations(30, seed=2, log_pace=log_pace)
    found = learned(many, "mdce_irl")
    assert found.durations[1].startswith("left-out episodes support dwell times that differ by pl")
    pace, seen = np.log(found.model.pace), np.bincount(many.state, minlength=GRID.n_states) > 15
    assert min(np.sum(seen & (log_pace > 0)), np.sum(seen & (log_pace == 0))) >= 3
    slow, fast = pace[seen & (log_pace > 0)].mean(), pace[seen & (log_pace == 0)].mean()
    # Paces are shrunk to 1, as their differences are in the shape of the laws already.
    assert 0.6 * np.log(3.0) < slow - fast < 1.1 * np.log(3.0)


def test_places_are_not_taken_where_they_do_not_differ_or_are_not_known(decisions):
    one = decisions.select_episodes(decisions.episodes[:1])
    for seen, reason in (
        (decisions, "do not support dwell times that differ by place"),
        (one, "is not known from 1 episode"),
    ):
        found = learned(seen, "mdce_irl", minimum_decisions=1)
        assert found.model.pace == ()
        assert found.durations[1].endswith(reason)


def test_parameters_and_draws_come_back_from_the_model_file(decisions, tmp_path):
    """A strategy plans with what the fit learned."""
    few = decisions.select_episodes(decisions.episodes[:4])
    found, path = learned(few, "mdce_serd_evidence"), tmp_path / "model.yaml"
    save_yaml_model(path, found.model)
    file = load_model(path)
    assert file == found.model
    back = learned_dynamics(path, file, PROBLEM)
    table = MODEL.local_probabilities
    np.testing.assert_allclose(table(back), table(found.fit.parameters.truth), atol=1e-9)
    draws = dynamics_of_draws(path, file, PROBLEM)
    assert len(draws) == len(file.draws.mean_s)
    laws = MODEL.laws(draws)
    np.testing.assert_allclose(np.exp(draws[:, MODEL.means]), file.draws.mean_s)
    np.testing.assert_allclose(np.exp(draws[:, MODEL.shapes]), file.draws.shape)
    assert np.isfinite(laws.probability).all()
