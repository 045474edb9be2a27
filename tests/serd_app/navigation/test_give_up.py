"""Patience and chances, decision by decision."""

import numpy as np
import pytest

from serd_app.navigation.give_up import GiveUp, GiveUpRules, Patience
from serd_core.arrival.chain import ArrivalByState
from serd_core.errors import SerdError

#: States 0, 1, 2 have a mean of 3, 2, 1 periods to go; the goal is state 3.
CDF = np.array(
    [[0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 1]], dtype=np.float64
)
ARRIVAL = ArrivalByState(CDF, np.ones(4))


def said(rules, states, left=10):
    patience = Patience(rules)
    return [patience.see(ARRIVAL, state, left) for state in states]


def test_means_of_this_case_are_what_they_are_meant_to_be():
    assert ARRIVAL.mean_periods.tolist() == [3, 2, 1, 0]


def test_going_to_and_fro_is_no_progress():
    assert said(GiveUpRules(3, 0.0), [0, 1, 0, 1, 0]) == [None] * 4 + [GiveUp.NO_PROGRESS]


def test_every_new_least_renews_the_patience():
    assert said(GiveUpRules(2, 0.0), [0, 0, 1, 1, 2, 2]) == [None] * 6


def test_off_the_grid_there_is_no_progress_but_no_chance_to_judge_either():
    assert said(GiveUpRules(3, 0.9), [0, -1, -1]) == [None] * 3
    assert said(GiveUpRules(2, 0.9), [0, -1, -1]) == [None, None, GiveUp.NO_PROGRESS]


def test_too_few_periods_left_make_an_arrival_unlikely():
    rules = GiveUpRules(0, 0.5)
    assert said(rules, [0], left=3) == [None]
    assert said(rules, [0], left=2) == [GiveUp.UNLIKELY]
    assert said(rules, [0], left=-1) == [GiveUp.UNLIKELY]


def test_rules_out_of_range_are_refused():
    with pytest.raises(SerdError, match="patience_periods must not be negative, got -1"):
        GiveUpRules(-1, 0.0)
    with pytest.raises(SerdError, match="minimum_arrival_probability must be a probability, got 7"):
        GiveUpRules(1, 7.0)
