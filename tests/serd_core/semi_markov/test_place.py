import numpy as np
import pytest

import serd_core as sc
from support.refusals import refusals
from tests.support.semi_markov import PLACES, demonstrations, ring, timed_ring


def paced_ring(deviation, n_episodes, seed=15):
    rng = np.random.default_rng(seed)
    pace = rng.normal(0.0, deviation, PLACES)
    world, truth = timed_ring(log_pace=pace)
    decisions = demonstrations(world, truth, rng, n_episodes=n_episodes)
    return timed_ring()[0], truth, pace, decisions


def test_multipliers_of_places_are_found_and_chosen():
    timed, truth, pace, decisions = paced_ring(0.5, 60)
    found = sc.fit_places(timed, decisions, truth)
    visited = np.bincount(decisions.state, minlength=PLACES) > 5
    assert np.all(np.abs(found.log_pace - pace)[visited] < 3.5 * found.its_deviation[visited])
    assert 0.25 < found.deviation < 1.0
    # Nothing is known of the goal, where nobody decides.
    assert found.log_pace[0] == pytest.approx(0.0, abs=1e-9)
    assert found.its_deviation[0] == pytest.approx(found.deviation)
    compared = sc.compare_places(timed, decisions)
    assert compared.chosen == "laws and places"
    assert np.all(np.diff(compared.log_likelihood) > 0)


def test_where_places_do_not_differ_the_multipliers_shrink_and_are_not_chosen():
    timed, truth, _, decisions = paced_ring(0.0, 60)
    found = sc.fit_places(timed, decisions, truth)
    assert np.abs(found.log_pace).max() < 0.15
    assert sc.compare_places(timed, decisions).chosen == "laws of local models"


TIMED, TRUTH, _, DECISIONS = paced_ring(0.5, 3)
PACED = sc.semi_markov_problem(TIMED, log_pace=np.ones(PLACES))
TWO = DECISIONS.select_episodes(DECISIONS.episodes[:2])


test_problems_without_laws_or_with_places_are_refused = refusals(
    (lambda: sc.fit_places(PACED, DECISIONS, TRUTH), "problem must have no log_pace yet"),
    (lambda: sc.compare_places(PACED, DECISIONS), "problem must have no log_pace yet"),
    (lambda: sc.compare_places(TIMED, TWO), "must hold at least 3 episodes"),
    (lambda: sc.fit_places(ring(), TWO, TRUTH), "problem must have dwell times, got transitio"),
)
