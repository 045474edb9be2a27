"""What is known of a fit whose moves take time, its standard errors, and how both are printed."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.learning.knowledge import (
    certainty_of,
    knowledge_lines,
    load_knowledge,
)
from serd_app.learning.outcome import outcome_files, save_outcome
from serd_app.learning.recipe import learn
from serd_app.learning.settings import LearningSettings
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import AGAINST_FLOW, MODEL_NAMES, WAITING, WITH_FLOW
from tests.support.timed_hallway import MEAN_S, TASK, timed_decisions

PROBLEM = TASK.problem


@pytest.fixture(scope="module")
def decisions():
    return timed_decisions()


@pytest.fixture(scope="module")
def outcome(decisions):
    return learn(TASK, Demonstrations(decisions), LearningSettings())


@pytest.fixture(scope="module")
def certainty(outcome, decisions):
    return certainty_of(outcome.problem, decisions, outcome.fit)


def test_each_law_has_its_intervals_and_its_sources(outcome, decisions):
    assert not any("counted" in line for line in outcome.durations)
    rows = outcome.knowledge.durations
    assert [row.model for row in rows] == list(MODEL_NAMES[:WAITING])
    for row in rows:
        assert 0 < row.lower_s < row.median_s < row.upper_s
        assert row.lower_s < row.over_forward_lower_s < row.over_forward_upper_s
        assert row.confounded_with in PROBLEM.feature_names
        assert -1 <= row.correlation <= 1
    seen = rows[WITH_FLOW]
    assert seen.lower_s < MEAN_S[WITH_FLOW] < seen.upper_s
    assert seen.known_from.startswith("dwell times")
    assert seen.from_dwell_times_nats > rows[AGAINST_FLOW].from_dwell_times_nats
    model_of = PROBLEM.outcome_models.model_of[decisions.state, decisions.action]
    stays = decisions.next_state == decisions.state
    informing = (model_of == WITH_FLOW) & (~stays | decisions.censored)
    assert seen.dwell_times == np.count_nonzero(informing)


def test_outcomes_count_what_was_reached(outcome, decisions):
    model_of = PROBLEM.outcome_models.model_of[decisions.state, decisions.action]
    assert decisions.censored.any()
    for number, name in enumerate(MODEL_NAMES):
        row = outcome.knowledge.by_model[name][Outcome.FORWARD]
        assert row.decisions == np.count_nonzero((model_of == number) & ~decisions.censored)
        assert 0 < row.lower < row.median < row.upper < 1


def test_a_line_per_law_one_of_what_is_confounded_and_one_of_the_next_start(outcome):
    lines = list(knowledge_lines(outcome.knowledge, PROBLEM))
    assert len(lines) == len(MODEL_NAMES) + WAITING + 2
    laws = lines[len(MODEL_NAMES) : -2]
    assert [line.split(",")[0] for line in laws] == [
        name.replace("_", " ") for name in MODEL_NAMES[:WAITING]
    ]
    for line, row in zip(laws, outcome.knowledge.durations, strict=True):
        assert f"mean {row.median_s:.2f} s ({row.lower_s:.2f} to {row.upper_s:.2f})" in line
    most = max(outcome.knowledge.durations, key=lambda row: abs(row.correlation))
    assert lines[-2].startswith("most confounded: how long a move ")
    assert lines[-2].endswith(f"correlation {most.correlation:+.2f}")
    assert lines[-1].startswith("a demonstration from ")


def test_where_no_law_was_learned_nothing_is_printed_of_any(decisions):
    settings = LearningSettings(method="mdce_serd_evidence")
    hidden = replace(decisions, action=np.full(len(decisions), -1))
    found = learn(TASK, Demonstrations(hidden), settings)
    assert found.knowledge.durations == ()
    assert not any("dwell times" in line for line in knowledge_lines(found.knowledge, PROBLEM))
    assert found.durations[0].startswith("a move takes on average, counted: with flow ")
    certainty = certainty_of(found.problem, hidden, found.fit)
    assert certainty.problem == ""
    assert np.all(np.isfinite(certainty.errors.reward))


def test_laws_are_read_back_as_written_and_removed_with_a_later_fit(outcome, tmp_path):
    output = tmp_path / "model.yaml"
    save_outcome(output, outcome, PROBLEM.grid)
    files = outcome_files(output)
    assert load_knowledge(files, PROBLEM.grid) == outcome.knowledge
    save_outcome(output, replace(outcome, knowledge=None), PROBLEM.grid)
    assert not files["durations"].exists()


def test_a_demonstration_teaches_most_where_its_start_is_not_the_goal(outcome):
    gain = outcome.knowledge.gain_nats
    np.testing.assert_array_equal(gain[PROBLEM.goal_states], 0.0)
    assert outcome.knowledge.next_start.gain_nats == gain.max() > 0


def test_fits_with_dwell_times_have_standard_errors(outcome, certainty):
    assert certainty.problem == ""
    errors = certainty.errors
    assert np.all(np.isfinite(errors.reward))
    assert errors.outcome_probabilities.shape == (len(MODEL_NAMES), len(Outcome))
    forward = outcome.model.outcome_models[WITH_FLOW].learned[Outcome.FORWARD]
    n = outcome.knowledge.by_model[MODEL_NAMES[WITH_FLOW]][0].decisions
    expected = np.sqrt(forward * (1.0 - forward) / n)
    found = errors.outcome_probabilities[WITH_FLOW, Outcome.FORWARD]
    assert found == pytest.approx(expected, rel=0.5)


def test_what_decisions_leave_open_is_named_by_model(decisions):
    """Choices of one cell, all by one action, and its dwell times."""
    model_of = PROBLEM.outcome_models.model_of[decisions.state, decisions.action]
    seen = decisions.select(np.flatnonzero(model_of == WITH_FLOW)[:20])
    found = learn(TASK, Demonstrations(seen), LearningSettings(minimum_decisions=1))
    open_numbers = certainty_of(found.problem, seen, found.fit).open_dynamics
    assert (AGAINST_FLOW, "shape of dwell times") in open_numbers
    assert (WITH_FLOW, "mean dwell time") not in open_numbers
    models = [model for model, _ in open_numbers]
    assert models == sorted(models)


def test_where_decisions_take_the_same_time_commands_that_end_them_are_choices(decisions):
    settings = LearningSettings(method="mdce_serd", prior_weights=(1.0,))
    found = learn(TASK, Demonstrations(decisions), settings)
    certainty = certainty_of(found.problem, decisions, found.fit)
    assert decisions.censored.any()
    assert certainty.problem == ""
    assert np.all(np.isfinite(certainty.errors.reward))
    assert not any("dwell" in name for _, name in certainty.open_dynamics)
