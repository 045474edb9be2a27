"""Progress and probability of arrival, decision by decision."""

import numpy as np
import pytest
from pydantic import ValidationError

from serd_app.navigation.give_up import GiveUp, ProgressMonitor
from serd_app.navigation.settings import NavigationSettings
from serd_core.arrival.chain import ArrivalByState

#: States 0, 1, 2 have a mean of 3, 2, 1 periods to go; the goal is state 3.
CDF = np.array(
    [[0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 1]], dtype=np.float64
)
ARRIVAL = ArrivalByState(CDF, np.ones(4))


def rules(patience_periods, minimum_arrival_probability):
    return NavigationSettings(
        patience_periods=patience_periods, minimum_arrival_probability=minimum_arrival_probability
    )


def reasons(settings, states, left=10):
    monitor = ProgressMonitor(settings)
    return [monitor.update(ARRIVAL, state, left) for state in states]


def test_means_of_this_case_are_what_they_are_meant_to_be():
    assert ARRIVAL.mean_periods.tolist() == [3, 2, 1, 0]


def test_going_to_and_fro_is_no_progress():
    assert reasons(rules(3, 0.0), [0, 1, 0, 1, 0]) == [None] * 4 + [GiveUp.NO_PROGRESS]


def test_every_new_minimum_counts_as_progress():
    assert reasons(rules(2, 0.0), [0, 0, 1, 1, 2, 2]) == [None] * 6


def test_off_the_grid_there_is_no_progress_but_no_chance_to_judge_either():
    assert reasons(rules(3, 0.9), [0, -1, -1]) == [None] * 3
    assert reasons(rules(2, 0.9), [0, -1, -1]) == [None, None, GiveUp.NO_PROGRESS]


def test_too_few_periods_left_make_an_arrival_unlikely():
    unlikely = rules(0, 0.5)
    assert reasons(unlikely, [0], left=3) == [None]
    assert reasons(unlikely, [0], left=2) == [GiveUp.UNLIKELY]
    assert reasons(unlikely, [0], left=-1) == [GiveUp.UNLIKELY]


def test_rules_out_of_range_are_refused():
    with pytest.raises(ValidationError, match=r"patience_periods\n.*greater than or equal to 0"):
        rules(-1, 0.0)
    with pytest.raises(ValidationError, match=r"probability\n.*less than or equal to 1"):
        rules(1, 7.0)
