"""The headline and the summary of every outcome predict only what is supported."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.learning.criticism import RecordedTimes
from serd_app.navigation.navigator import plan_remarks
from serd_app.report.charts import draw_forecasts
from serd_app.report.inputs import Forecast
from serd_app.report.summary import headline_of, summary_of
from serd_app.report.write import render_page, summary_rows
from serd_files.model_file import Check
from support.episodes import episode_result
from tests.serd_app.report.conftest import strategy_of


@pytest.fixture
def undriven(inputs):
    """The report of a model by which nothing drove, with its forecast."""
    forecast = Forecast("area train", inputs.predicted)
    return replace(inputs, episodes=(), forecasts=(forecast,), n_demonstrations=6)


def recorded(*times_s, n_outside=0):
    return RecordedTimes(np.array(times_s), np.arange(len(times_s)) < n_outside)


def checked(inputs, *checks):
    """The same whose model file carries checks."""
    file = inputs.strategy.file.model_copy(update={"checks": checks})
    return replace(inputs, strategy=replace(inputs.strategy, file=file))


def trapped(inputs):
    """The same with a policy that has learned to shun the goal."""
    strategy, weights = inputs.strategy, np.array([-1.0, 0.0, 0.0])
    shuns = strategy_of(weights, strategy.scenario, strategy.problem, inputs.fit)
    return replace(inputs, strategy=shuns)


@pytest.mark.parametrize(
    ("changes", "reason", "begins", "known"),
    [
        (
            {"n_demonstrations": 1, "recorded": recorded(41.0)},
            "a prediction takes at least 3 demonstrations, and the model was learned from 1",
            "After 1 demonstration with 59 decisions, which arrived after 41 s, the arrival",
            "1 of them, after 41 s",
        ),
        (
            {"recorded": recorded(90.0, 100.0, 110.0, n_outside=3)},
            "3 of 3 recorded drives arrived outside the 90 % band that the model computes",
            "After 6 demonstrations with 59 decisions, of which 3 arrived after 90 s to 110 s, the",
            "3 of them, after 90 s to 110 s",
        ),
    ],
)
def test_what_does_not_support_a_prediction_stands_in_its_place(
    undriven, changes, reason, begins, known
):
    summary = summary_of(replace(undriven, **changes))
    headline = headline_of(summary)
    assert headline.startswith(begins)
    assert headline.endswith(f"of the robot is not predicted, because {reason}.")
    rows = dict(summary_rows(summary))
    assert rows["Predicted arrival"] == f"none, because {reason}"
    assert rows.get("Recorded arrivals") == known
    assert "Arrives" not in rows
    assert summary["no_prediction_because"] == (reason,)


def test_a_supported_prediction_is_stated_and_one_from_a_trap_is_not(undriven):
    given = replace(undriven, recorded=recorded(20.0, 21.0, 22.0, n_outside=1))
    summary = summary_of(given)
    assert summary["no_prediction_because"] == ()
    assert dict(summary_rows(summary))["Arrives"].startswith("predicted")
    assert "the robot is predicted to reach the goal within 2 min with" in headline_of(summary)
    summary = summary_of(trapped(undriven))
    assert summary["n_least_time_states"] > 10
    assert summary["n_trap_states"] == 0
    (reason,) = summary["no_prediction_because"]
    assert (
        reason == "the learned policy does not arrive from 2 of the 2 cells in which drives begin"
    )
    assert headline_of(summary).endswith(f"is not predicted, because {reason}.")
    assert dict(summary_rows(summary))["Plan"].startswith("The learned policy does not arrive from")


def test_measured_drives_stand_beside_a_prediction_they_support_only(inputs):
    assert "; predicted" in dict(summary_rows(summary_of(inputs)))["Arrived"]
    assert "75 %; predicted" in headline_of(summary_of(inputs))
    missed = tuple(episode_result(number, "timeout") for number in range(3))
    summary = summary_of(replace(inputs, episodes=missed))
    rows, headline = dict(summary_rows(summary)), headline_of(summary)
    assert "in 0 of 3 new episodes within 2 min (0 %; no prediction, because " in headline
    assert headline.endswith("fewer than half of them in time.")
    assert "3 of 3 measured drives arrived outside the 90 % band" in rows["Predicted arrival"]
    assert "; predicted" not in headline + " ".join(rows.values())
    assert summary["measured_mean_s"] is None
    assert "more than half never arrived" in rows["Median time of arrival"]


def test_recorded_drives_are_drawn_on_the_forecast_from_the_first_to_the_last(undriven):
    laws = {"area train": undriven.predicted}
    (axes,) = draw_forecasts(laws, 120.0, [150.0, 31.0, 40.0]).axes
    (dots,) = [line for line in axes.lines if line.get_label() == "recorded: 3 drives"]
    assert dots.get_xdata().tolist() == [31.0, 40.0, 150.0]
    assert dots.get_ydata() == pytest.approx([1 / 3, 2 / 3, 1.0])
    first_s, last_s = axes.get_xlim()
    assert first_s < 31.0 < 150.0 < last_s
    (alone,) = draw_forecasts(laws, 120.0).axes
    assert len(alone.lines) == len(axes.lines) - 2


def test_the_first_check_that_fails_is_the_headline_and_every_check_is_a_row_of_the_page(undriven):
    checks = (
        Check(key="rollouts", mark="holds", sentence="it arrives"),
        Check(key="outcomes", mark="fails", sentence="3 of 9 moves led on, where 80 % should"),
        Check(key="ways", mark="fails", sentence="there is no way"),
    )
    given = checked(undriven, *checks)
    summary = summary_of(given)
    assert headline_of(summary) == "3 of 9 moves led on, where 80 % should."
    assert summary["no_prediction_because"] == tuple(each.sentence for each in checks[1:])
    assert plan_remarks(given.strategy)[0].endswith(checks[1].sentence)
    page = render_page(given, summary, dict.fromkeys(("forecast", "policy", "outcomes"), b""))
    for check in checks:
        assert f'<tr class="{check.mark}"><th scope="row">' in page
        assert f"{check.sentence[1:]}.</td>" in page
