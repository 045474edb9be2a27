"""What `serd learn` prints of a fit whose moves take time."""

from pathlib import Path

import numpy as np
import pytest

from serd_app.journeys.learn import Learned
from serd_app.learning.knowledge import Certainty, certainty_of
from serd_app.learning.learning_files import LearningFiles
from serd_app.learning.recipe import learn
from serd_app.learning.settings import LearningSettings
from serd_cli.output.fit import learned_values, print_learned
from serd_cli.output.terminal import console
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import WITH_FLOW
from tests.support.timed_hallway import TASK, timed_decisions


@pytest.fixture(scope="module")
def learned():
    decisions = timed_decisions()
    outcome = learn(TASK, decisions, LearningSettings())
    certainty = certainty_of(outcome.problem, decisions, outcome.fit)
    episodes = decisions.episodes
    goal = tuple(TASK.problem.grid.centers_m[TASK.problem.goal_states[0]].tolist())
    files = LearningFiles(TASK, decisions, "scenario", (goal,), 0, 0, 0, (), episodes)
    return files, outcome, certainty


def printed(files, outcome, certainty) -> str:
    with console.capture() as captured:
        print_learned(Learned(files, outcome, certainty, Path("model.yaml")))
    return captured.get()


def test_errors_laws_with_intervals_and_what_is_open_are_printed(learned):
    files, outcome, certainty = learned
    text = printed(files, outcome, Certainty(certainty.errors, open_rewards=("social_norm",)))
    assert "no standard errors" not in text
    forward = outcome.model.outcome_models[WITH_FLOW].learned[Outcome.FORWARD]
    error = certainty.errors.outcome_probabilities[WITH_FLOW, Outcome.FORWARD]
    law = outcome.knowledge.durations[WITH_FLOW]
    for words in (
        f"{100 * forward:.1f}±{100 * error:.1f}",
        f"{certainty.errors.reward[0]:.2f}",
        f"with flow, time of a move: {law.known_from};",
        f"mean {law.median_s:.2f} s ({law.lower_s:.2f} to {law.upper_s:.2f})",
        "against flow: ",
        "most confounded: how long a move ",
        "so the prior decides: social norm",
        "the learned policy ",
    ):
        assert words in text


def test_values_by_name_have_probabilities_and_what_is_known_of_laws(learned):
    _, outcome, certainty = learned
    values = learned_values(Learned(*learned, Path("model.yaml")))
    table = np.array(values["outcome_probabilities"])
    np.testing.assert_allclose(table.sum(axis=1), 1.0)
    assert table.shape == np.shape(values["outcome_standard_errors"])
    np.testing.assert_allclose(values["standard_errors"], certainty.errors.reward)
    durations = values["knowledge"]["durations"]
    assert [each["model"] for each in durations] == ["with_flow", "against_flow", "across_flow"]
    assert durations[0]["median_s"] == outcome.knowledge.durations[0].median_s
