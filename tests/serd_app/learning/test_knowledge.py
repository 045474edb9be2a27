"""What is known of a fit whose moves take time, its standard errors, and how both are printed."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.learning.knowledge import (
    certainty_of,
    knowledge_lines,
    knowledge_of,
    load_knowledge,
    posterior_of,
)
from serd_app.learning.outcome import outcome_files, save_outcome
from serd_app.learning.recipe import learn, task_in
from serd_app.learning.settings import LearningSettings
from serd_core.bayes.laplace import N_DRAWS
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import AGAINST_FLOW, MODEL_NAMES, WAITING, WITH_FLOW
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import GaussianPrior
from serd_sim.scenario.scenario import load_scenario
from tests.support.timed_hallway import MEAN_S, TASK, timed_decisions

PROBLEM = TASK.problem


@pytest.fixture(scope="module")
def decisions():
    return timed_decisions()


@pytest.fixture(scope="module")
def outcome(decisions):
    return learn(TASK, decisions, LearningSettings())


def certainty_with(decisions, **settings):
    fit = learn(TASK, decisions, LearningSettings(**settings))
    return certainty_of(fit.problem, fit.decisions, fit.fit)


def test_every_outcome_has_its_interval_and_counts_what_was_reached(outcome, decisions):
    known = outcome.knowledge
    assert [row.model for row in known.outcomes[:: len(Outcome)]] == list(MODEL_NAMES)
    assert all(0 < row.lower < row.median < row.upper < 1 for row in known.outcomes)
    with_flow, against = (known.by_model[MODEL_NAMES[m]][0] for m in (WITH_FLOW, AGAINST_FLOW))
    assert with_flow.from_transitions_nats > against.from_transitions_nats
    assert "counts" in with_flow.known_from
    model_of = PROBLEM.outcome_models.model_of[decisions.state, decisions.action]
    assert decisions.censored.any()
    for number, name in enumerate(MODEL_NAMES):
        reached = np.count_nonzero((model_of == number) & ~decisions.censored)
        assert known.by_model[name][Outcome.FORWARD].decisions == reached


def test_every_law_has_its_intervals_its_sources_and_what_it_is_confounded_with(outcome, decisions):
    assert not any("counted" in line for line in outcome.durations)
    rows = outcome.knowledge.durations
    assert [row.model for row in rows] == list(MODEL_NAMES[:WAITING])
    for row in rows:
        assert 0 < row.lower_s < row.median_s < row.upper_s
        assert row.lower_s < row.over_forward_lower_s < row.over_forward_upper_s
        assert row.over_forward_median_s > row.median_s
        assert row.confounded_with in PROBLEM.feature_names
        assert -1 <= row.correlation <= 1
    seen, against = rows[WITH_FLOW], rows[AGAINST_FLOW]
    assert seen.lower_s < MEAN_S[WITH_FLOW] < seen.upper_s
    assert seen.upper_s / seen.lower_s < against.upper_s / against.lower_s
    assert seen.known_from.startswith("dwell times")
    assert seen.from_dwell_times_nats > against.from_dwell_times_nats
    model_of = PROBLEM.outcome_models.model_of[decisions.state, decisions.action]
    stays = decisions.next_state == decisions.state
    informing = (model_of == WITH_FLOW) & (~stays | decisions.censored)
    assert seen.dwell_times == np.count_nonzero(informing)


def test_a_line_per_model_per_law_one_of_what_is_confounded_and_one_of_the_next_start(outcome):
    lines, rows = list(knowledge_lines(outcome.knowledge, PROBLEM)), outcome.knowledge.durations
    names = [name.replace("_", " ") for name in MODEL_NAMES]
    times = [f"{name}, time of a move" for name in names[:WAITING]]
    assert [line.split(":")[0] for line in lines[:-1]] == [*names, *times, "most confounded"]
    assert all(" nats, choices: " in line for line in lines[:-2])
    for line, row in zip(lines[len(names) : -2], rows, strict=True):
        assert f"mean {row.median_s:.2f} s ({row.lower_s:.2f} to {row.upper_s:.2f})" in line
    most = max(rows, key=lambda row: abs(row.correlation))
    assert lines[-2].startswith("most confounded: how long a move ")
    assert lines[-2].endswith(f"correlation {most.correlation:+.2f}")
    best, gain = outcome.knowledge.next_start, outcome.knowledge.gain_nats
    assert lines[-1].startswith(f"a demonstration from {best.x_m:g},{best.y_m:g} is expected")
    assert gain.shape == (PROBLEM.grid.n_states,)
    np.testing.assert_array_equal(gain[PROBLEM.goal_states], 0.0)
    assert best.gain_nats == gain.max() > 0


def test_it_is_read_back_as_written_for_its_grid_alone_and_removed_with_a_later_fit(
    outcome, tmp_path
):
    output, files = tmp_path / "model.yaml", outcome_files(tmp_path / "model.yaml")
    save_outcome(output, outcome, PROBLEM.grid)
    assert load_knowledge(files, PROBLEM.grid) == outcome.knowledge
    other = task_in(load_scenario("crossing"), 0.99).problem.grid
    with pytest.raises(SerdError, match=r"must have a row for each of \d+ cells, got \d+; learn"):
        load_knowledge(files, other)
    save_outcome(output, replace(outcome, knowledge=None), PROBLEM.grid)
    assert load_knowledge(files, PROBLEM.grid) is None
    assert not files["durations"].exists()
    assert not files["gain"].exists()


def test_the_model_holds_draws_around_the_joint_fit(outcome, decisions):
    draws, fit = outcome.model.draws, fit_mdce_serd(outcome.problem, decisions)
    assert len(draws.reward_weights) == len(draws.learned) == N_DRAWS
    weights, tables = np.array(draws.reward_weights), np.array(draws.learned)
    error = weights.std(axis=0) / np.sqrt(N_DRAWS)
    assert np.all(np.abs(weights.mean(axis=0) - fit.reward_weights) < 4 * error)
    error = tables.std(axis=0) / np.sqrt(N_DRAWS)
    assert np.all(np.abs(tables.mean(axis=0) - fit.outcome_probabilities) < 0.01 + 4 * error)
    rows = outcome.knowledge.by_model[MODEL_NAMES[WITH_FLOW]]
    low, high = (np.array([getattr(row, end) for row in rows]) for end in ("lower", "upper"))
    inside = (tables[:, WITH_FLOW] >= low) & (tables[:, WITH_FLOW] <= high)
    assert 0.75 < inside.mean() < 0.99
    law = outcome.knowledge.durations[WITH_FLOW]
    assert np.median(draws.mean_s, axis=0)[0] == pytest.approx(law.median_s, rel=0.05)


def test_a_fit_without_a_posterior_of_the_dynamics_has_none(decisions):
    problem, table = PROBLEM.by_decisions, np.full((4, 5), 0.2)
    for prior in (None, GaussianPrior(1.0, Block.REWARD)):
        fit = fit_mdce_irl_by_likelihood(
            problem, decisions, initial_weights=np.zeros(3), dynamics=table, prior=prior
        )
        posterior = posterior_of(problem, decisions, fit)
        assert (posterior is None) == (prior is None)
        assert posterior is None or knowledge_of(problem, posterior) is None


def test_where_no_law_was_learned_nothing_is_printed_of_any(decisions):
    hidden = replace(decisions, action=np.full(len(decisions), -1))
    found = learn(TASK, hidden, LearningSettings())
    assert found.knowledge.durations == ()
    assert not any("dwell times" in line for line in knowledge_lines(found.knowledge, PROBLEM))
    assert found.durations[0].startswith("a move takes on average, counted: with flow ")
    certainty = certainty_of(found.problem, hidden, found.fit)
    assert certainty.problem == ""
    assert np.all(np.isfinite(certainty.errors.reward))


def test_fits_have_standard_errors_also_where_decisions_take_the_same_time(outcome, decisions):
    certainty = certainty_of(outcome.problem, decisions, fit_mdce_serd(outcome.problem, decisions))
    same_time = certainty_with(decisions, method="mdce_serd", prior_weights=(1.0,))
    for each in (certainty, same_time):
        assert each.problem == ""
        assert np.all(np.isfinite(each.errors.reward))
    errors = certainty.errors.outcome_probabilities
    assert errors.shape == (len(MODEL_NAMES), len(Outcome))
    forward = outcome.model.outcome_models[WITH_FLOW].learned[Outcome.FORWARD]
    n = outcome.knowledge.by_model[MODEL_NAMES[WITH_FLOW]][0].decisions
    expected = np.sqrt(forward * (1.0 - forward) / n)
    assert errors[WITH_FLOW, Outcome.FORWARD] == pytest.approx(expected, rel=0.5)
