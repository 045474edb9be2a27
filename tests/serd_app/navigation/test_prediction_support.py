"""When a predicted arrival may be stated: enough demonstrations, a start, and times that agree."""

import re

import numpy as np
import pytest

from serd_app.learning.criticism import RecordedTimes, outside_band, recorded_times
from serd_app.navigation.comparison import Starts, compare, reasons_against_prediction, starts_of
from serd_app.teleop.page.view import overlay_of
from serd_core.arrival.law import ArrivalLaw
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_files.model_file import load_model
from serd_sim.drivers.strategy import load_strategy, start_distribution
from serd_sim.scenario.scenario import load_scenario
from support.episodes import episode_result

HALLWAY = load_scenario("hallway")
GOOD = Starts(9, 0)
#: Even between 10 s and 30 s, and of 84 in 100 drives.
EVEN = ArrivalLaw(np.linspace(10.0, 30.0, 201), np.linspace(0.0, 1.0, 201), 1.0)
PARTLY = ArrivalLaw(EVEN.times_s, 0.84 * EVEN.cdf, 0.84)


@pytest.fixture
def strategy(save_model_of):
    return load_strategy(str(save_model_of()), HALLWAY, "optimal")


def drives_of(strategy, n_drives):
    """Drives by the policy under the dynamics of the model."""
    return sample_timed_decisions(
        strategy.problem.mdp,
        strategy.policy.probabilities,
        strategy.draws[0],
        start_distribution(HALLWAY, "train"),
        n_episodes=n_drives,
        n_steps=300,
        rng=np.random.default_rng(0),
    )


def reasons(n_demonstrations=20, starts=GOOD, **given):
    return reasons_against_prediction(n_demonstrations=n_demonstrations, starts=starts, **given)


@pytest.mark.parametrize(
    ("number", "starts", "reason"),
    [
        (3, GOOD, None),
        (2, GOOD, "a prediction takes at least 3 demonstrations, .* learned from 2"),
        (20, Starts(4, 4), "does not arrive from 4 of the 4 cells in which drives begin"),
        (20, Starts(1, 1), "does not arrive from the cell in which drives begin"),
    ],
)
def test_few_demonstrations_and_starts_in_a_trap_support_no_prediction(number, starts, reason):
    stated = reasons(number, starts)
    assert len(stated) == (reason is not None)
    assert all(re.search(f"{reason}$", each) for each in stated)


def test_recorded_drives_that_follow_the_model_support_its_prediction(strategy):
    decisions = drives_of(strategy, 40)
    assert starts_of(strategy, "train").n_trapped == 0
    recorded = recorded_times(strategy, decisions, decisions.episodes)
    assert recorded.times_s == pytest.approx(np.bincount(decisions.episode, decisions.dwell_s))
    assert recorded.outside.mean() <= 0.1
    assert reasons(recorded=recorded) == ()
    law = strategy.law_from(start_distribution(HALLWAY, "train"))
    assert np.median(recorded.times_s) == pytest.approx(law.quantile_s(0.5), abs=4.0)
    assert len(recorded_times(strategy, decisions, decisions.episodes[[1, 4]]).times_s) == 2


def test_times_are_outside_below_and_above_the_band_and_late_ones_only_where_it_ends():
    times_s = np.array([10.9, 11.0, 20.0, 29.0, 29.2, np.inf])
    assert outside_band(EVEN, times_s).tolist() == [True, False, False, False, True, True]
    assert not outside_band(PARTLY, np.inf)
    assert outside_band(ArrivalLaw(EVEN.times_s, 0.01 * EVEN.cdf, 0.01), 20.0)


def test_measured_drives_speak_against_a_prediction_and_three_replace_those_of_persons():
    assert reasons(measured=(PARTLY, np.full(3, np.inf))) == (
        "0 of 3 measured drives arrived, where the model computes 84%",
    )
    assert reasons(measured=(PARTLY, np.array([15.0, 20.0, np.inf]))) == ()
    recorded = RecordedTimes(np.full(3, 20.0), np.ones(3, dtype=bool))
    assert reasons(recorded=recorded, measured=(EVEN, np.array([15.0, 20.0, 25.0]))) == ()
    assert len(reasons(recorded=recorded, measured=(EVEN, np.array([15.0, 20.0])))) == 1


def test_a_comparison_and_the_layers_of_a_page_state_the_same_reasons(save_model_of, strategy):
    assert strategy.file.fit.n_episodes == 1
    (few,) = reasons(1, starts_of(strategy, "train"))
    law = strategy.law_from(start_distribution(HALLWAY, "train"))
    quantiles_s = [law.quantile_s(share) for share in (0.2, 0.5, 0.8)]
    times = [episode_result(number, "arrived", each) for number, each in enumerate(quantiles_s)]
    assert compare(strategy, "train", times).no_prediction_because == (few,)
    layer = overlay_of(strategy)["arrival"]
    assert layer["title"].startswith("Computed")
    assert layer["note"].endswith(f"no prediction, because {few}")
    fit = load_model(save_model_of()).fit.model_copy(update={"n_episodes": 20})
    many = load_strategy(str(save_model_of(fit=fit)), HALLWAY, "optimal")
    assert overlay_of(many)["arrival"]["title"].startswith("Predicted")
    late = [episode_result(number, "timeout") for number in range(3)]
    assert compare(many, "train", late).no_prediction_because == (
        "3 of 3 measured drives arrived outside the 90 % band that the model computes or not at"
        " all",
    )
