from dataclasses import replace

import numpy as np
import pytest

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.learning.knowledge import (
    knowledge_lines,
    knowledge_of,
    load_knowledge,
    posterior_of,
)
from serd_app.learning.outcome import outcome_files, save_outcome
from serd_app.learning.recipe import learn, task_in
from serd_app.learning.settings import LearningSettings
from serd_core.bayes.draws import N_DRAWS
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import AGAINST_FLOW, MODEL_NAMES, WITH_FLOW
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.parameters import Block
from serd_core.priors.gaussian import GaussianPrior
from serd_core.semi_markov.simulation import sample_timed_decisions
from serd_sim.scenario.grid import start_states_of
from serd_sim.scenario.scenario import load_scenario
from tests.conftest import MEAN_S, OUTCOMES

TASK = task_in(load_scenario("hallway"), 0.99)
PROBLEM, TABLE = TASK.problem, np.array(list(OUTCOMES.values()))
TRUTH = PROBLEM.mdp.transitions.parameters_from(TABLE, list(MEAN_S.values()), 4.0)


@pytest.fixture(scope="module")
def demonstrations():
    starts = np.zeros(PROBLEM.grid.n_states)
    starts[start_states_of(load_scenario("hallway"), PROBLEM.grid, "train")] = 1.0
    table = PROBLEM.mdp.transitions.local_probabilities(TRUTH)
    decisions = sample_timed_decisions(
        PROBLEM.mdp,
        soft_policy(PROBLEM, np.array([4.0, 1.0, -0.2]), table).probabilities,
        TRUTH,
        starts / starts.sum(),
        n_episodes=3,
        n_steps=60,
        rng=np.random.default_rng(2),
    )
    return Demonstrations(decisions)


@pytest.fixture(scope="module")
def outcome(demonstrations):
    return learn(TASK, demonstrations, LearningSettings())


def test_every_outcome_has_its_interval_and_every_cell_its_gain(outcome):
    known = outcome.knowledge
    assert [row.model for row in known.outcomes[:: len(Outcome)]] == list(MODEL_NAMES)
    assert all(0 < row.lower < row.median < row.upper < 1 for row in known.outcomes)
    with_flow = known.by_model[MODEL_NAMES[WITH_FLOW]]
    against = known.by_model[MODEL_NAMES[AGAINST_FLOW]]
    assert with_flow[0].from_transitions_nats > against[0].from_transitions_nats
    assert "counts" in with_flow[0].known_from
    assert known.gain_nats.shape == (PROBLEM.grid.n_states,)
    np.testing.assert_array_equal(known.gain_nats[PROBLEM.goal_states], 0.0)
    assert known.next_start.gain_nats == known.gain_nats.max() > 0


def test_a_line_per_outcome_model_and_one_for_the_next_demonstration(outcome):
    lines = list(knowledge_lines(outcome.knowledge, PROBLEM))
    names = [name.replace("_", " ") for name in MODEL_NAMES]
    times = [f"{name}, time of a move" for name in names[:3]]
    heads = [line.split(":")[0] for line in lines[:-1]]
    assert heads == [*names, *times, "most confounded"]
    assert all(" nats, choices: " in line for line in lines[:-2])
    best = outcome.knowledge.next_start
    assert lines[-1].startswith(f"a demonstration from {best.x_m:g},{best.y_m:g} is expected")


def test_it_is_read_back_as_written_and_removed_with_a_later_fit(outcome, tmp_path):
    output, grid = tmp_path / "model.yaml", PROBLEM.grid
    save_outcome(output, outcome, grid)
    files = outcome_files(output)
    assert load_knowledge(files, grid) == outcome.knowledge
    save_outcome(output, replace(outcome, knowledge=None), grid)
    assert load_knowledge(files, grid) is None


def test_gains_of_another_grid_are_rejected(outcome, tmp_path):
    save_outcome(tmp_path / "model.yaml", outcome, PROBLEM.grid)
    other = task_in(load_scenario("crossing"), 0.99).problem.grid
    with pytest.raises(SerdError, match=r"must have a row for each of \d+ cells, got \d+; learn"):
        load_knowledge(outcome_files(tmp_path / "model.yaml"), other)


def test_the_model_holds_draws_around_the_fit(outcome):
    draws = outcome.model.draws
    assert len(draws.reward_weights) == len(draws.learned) == N_DRAWS
    weights, fit = np.array(draws.reward_weights), outcome.fit
    error = weights.std(axis=0) / np.sqrt(N_DRAWS)
    assert np.all(np.abs(weights.mean(axis=0) - fit.reward_weights) < 4 * error)
    tables = np.array(draws.learned)
    error = tables.std(axis=0) / np.sqrt(N_DRAWS)
    assert np.all(np.abs(tables.mean(axis=0) - fit.outcome_probabilities) < 0.01 + 4 * error)
    rows = outcome.knowledge.by_model[MODEL_NAMES[WITH_FLOW]]
    low, high = (np.array([getattr(row, end) for row in rows]) for end in ("lower", "upper"))
    inside = (tables[:, WITH_FLOW] >= low) & (tables[:, WITH_FLOW] <= high)
    assert 0.75 < inside.mean() < 0.99


def test_every_law_has_its_interval_and_what_it_is_confounded_with(outcome):
    rows = outcome.knowledge.durations
    assert [row.model for row in rows] == list(MEAN_S)
    for row in rows:
        assert 0 < row.lower_s < row.median_s < row.upper_s
        assert row.over_forward_median_s > row.median_s
        assert -1 <= row.correlation <= 1
    with_flow, against, _ = rows
    assert with_flow.upper_s / with_flow.lower_s < against.upper_s / against.lower_s
    assert with_flow.lower_s < MEAN_S["with_flow"] < with_flow.upper_s
    assert with_flow.from_dwell_times_nats > against.from_dwell_times_nats
    values = outcome.model.draws.mean_s
    assert np.median(values, axis=0)[0] == pytest.approx(with_flow.median_s, rel=0.05)


def test_a_fit_without_a_posterior_of_the_dynamics_has_none(demonstrations):
    decisions, problem = demonstrations.decisions, PROBLEM.by_decisions
    fit = fit_mdce_irl_by_likelihood(
        problem, decisions, initial_weights=np.zeros(3), dynamics=TABLE
    )
    assert posterior_of(problem, decisions, fit) is None
    normal = GaussianPrior(1.0, Block.REWARD)
    fit = fit_mdce_irl_by_likelihood(
        problem, decisions, initial_weights=np.zeros(3), dynamics=TABLE, prior=normal
    )
    assert knowledge_of(problem, posterior_of(problem, decisions, fit)) is None
