"""Paces of people: found from their times, and times of arrival hold where people keep them."""

import numpy as np
import pytest
from scipy.stats import binom, gamma

from lab.experiments.study.people.paces import Paces
from lab.experiments.study.people.people import Asked
from serd_core.arrival.chain import ArrivalByState
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action, Grid

#: m, a, k, and how many people go through how many columns.
MEAN_S, BETWEEN, WITHIN, PEOPLE, COLUMNS = 0.8, 15.0, 20.0, 500, 12
GRID = Grid((0.0, 0.0), 0.8, np.ones((1, COLUMNS + 1), dtype=bool))


def walks(rng):
    """People of one pace each, who go straight along a corridor."""
    paces = rng.gamma(BETWEEN, 1.0 / (BETWEEN - 1.0), (PEOPLE, 1))
    dwell_s = MEAN_S / paces * rng.gamma(WITHIN, 1.0 / WITHIN, (PEOPLE, COLUMNS))
    state = np.tile(np.arange(COLUMNS), PEOPLE)
    return TimedDecisions(
        np.repeat(np.arange(PEOPLE), COLUMNS), (dwell_s.cumsum(axis=1) - dwell_s).ravel(),
        state=state, action=np.full(len(state), Action.EAST), next_state=state + 1,
        dwell_s=dwell_s.ravel(), censored=np.zeros(len(state), dtype=bool),
    )  # fmt: skip


def test_laws_of_paces_are_found_and_hold_the_times_of_people_who_keep_them():
    rng = np.random.default_rng(0)
    found = Paces.of(GRID, walks(rng))
    assert found.between == pytest.approx(BETWEEN, rel=0.25)
    assert found.within == pytest.approx(2 * WITHIN, rel=0.1)  # of two columns
    even = found.at_pace_one(walks(rng), 60.0, rng).dwell_s.reshape(PEOPLE, COLUMNS)
    of_pace_one = gamma(COLUMNS * WITHIN, scale=MEAN_S / WITHIN)  # of the sum of all columns
    assert even.sum(axis=1).std() == pytest.approx(of_pace_one.std(), rel=0.15)
    new, times_s = walks(rng), 0.01 * np.arange(4000)
    at_pace_one = gamma.cdf(times_s, 10 * WITHIN, scale=MEAN_S / WITHIN)
    rest_s = new.dwell_s.reshape(PEOPLE, COLUMNS)[:, 2:].sum(axis=1)
    asked = [Asked(person, 0, 0.0, time_s) for person, time_s in enumerate(rest_s)]
    arrival = ArrivalByState(at_pace_one[:, None], np.ones(1))
    laws = found.own_laws(times_s, arrival, asked, new.select(new.state < 2))
    shares = np.array([law.probability_by(s) for law, s in zip(laws, rest_s, strict=True)])
    held = int(((shares > 0.05) & (shares < 0.95)).sum())
    assert 0.01 < binom.cdf(held, PEOPLE, 0.9) < 0.99
