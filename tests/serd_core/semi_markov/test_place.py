import numpy as np
import pytest

import serd_core as sc
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


def test_a_plan_may_take_the_pace_of_places():
    timed, truth, _, decisions = paced_ring(0.5, 30)
    places = sc.fit_places(timed, decisions, truth)
    paced = sc.semi_markov_problem(timed, log_pace=places.log_pace)
    table = paced.mdp.transitions.local_probabilities(truth)
    assert sc.optimal_policy(paced, np.array([1.0, 0.0]), table).converged
    for fitted in (
        lambda: sc.fit_places(paced, decisions, truth),
        lambda: sc.compare_places(paced, decisions),
    ):
        with pytest.raises(sc.SerdError, match="problem must have no log_pace yet"):
            fitted()


def test_two_episodes_are_too_few_to_leave_some_out():
    timed, truth, _, decisions = paced_ring(0.5, 3)
    one = decisions.select_episodes(decisions.episodes[:2])
    with pytest.raises(sc.SerdError, match="must hold at least 3 episodes"):
        sc.compare_places(timed, one)
    with pytest.raises(sc.SerdError, match="problem must have dwell times, got transitions of"):
        sc.fit_places(ring(), one, truth)
