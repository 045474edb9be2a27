import numpy as np
import pandas as pd
import pytest

import serd_core as sc
from lab.experiments.durations import (
    AGAINST,
    FROM_PRIOR,
    PLACES,
    WITH,
    WITH_PLACES,
    DurationsConfig,
    demonstrate,
    learn,
    summary_of,
    world,
)

WITHOUT_PLACES = ("one outcome", "side outcomes")
CONFIG = DurationsConfig(sizes=(10,), draws=32)


@pytest.mark.parametrize("case", WITHOUT_PLACES)
def test_the_best_way_is_against_the_stream_only_close_to_the_goal(case):
    given = world(CONFIG, case, np.random.default_rng(0))
    assert given.ways(given.timed, given.table) == [AGAINST, WITH, WITH]


def test_choices_inform_about_a_move_that_no_demonstration_has():
    rng = np.random.default_rng(1)
    given = world(CONFIG, "one outcome", rng)
    demonstrations = demonstrate(given, rng)
    assert not np.any(demonstrations.action == AGAINST)
    assert demonstrations.censored.any()
    found = {
        learner: learn(given, learner, demonstrations, rng)[0]
        for learner in ("durations learned", "two steps")
    }
    joint, counted = found["durations learned"], found["two steps"]
    assert joint["converged"]
    assert abs(joint["mean_bias"]) < 0.6 < abs(counted["mean_bias"])
    assert joint["deviation"] < 0.8 < counted["deviation"]


def test_multipliers_of_places_are_found_better_than_none():
    rng = np.random.default_rng(1)
    given = world(CONFIG, WITH_PLACES, rng)
    found, plans = learn(given, "durations learned", demonstrate(given, rng), rng)
    for error in ("pace_error", "relative_pace_error"):
        assert found[error] < 0.7 * found[f"{error}_of_none"]
    assert found["pace_held"] > 0.6
    (problem, _), (without, _) = plans["right"], plans["no_places_right"]
    assert problem.mdp.transitions.n_models > without.mdp.transitions.n_models


def test_drawn_durations_have_the_prior_given_the_others():
    """Its mean is that of the other log means, nearly, as their common one is hardly known."""
    drawn = []
    for seed in range(400):
        given = world(CONFIG, FROM_PRIOR, np.random.default_rng(seed))
        means = given.timed.mdp.transitions.means
        drawn.append(given.truth[means][AGAINST])
        assert np.exp(np.delete(given.truth[means], AGAINST)) == pytest.approx([1.0, 1.2, 1.0])
    three_others = np.log(1.2) / 3.0
    assert np.mean(drawn) == pytest.approx(three_others, abs=0.15)
    assert np.std(drawn) == pytest.approx(np.sqrt(1.0 + 1.0 / 3.0), rel=0.08)


@pytest.mark.parametrize("case", WITHOUT_PLACES)
def test_the_next_demonstration_starts_where_both_ways_are_as_good(case):
    """Experts never went against the stream, so from there they show how long that takes."""
    rng = np.random.default_rng(2)
    given = world(CONFIG, case, rng)
    demonstrations = demonstrate(given, rng)
    assert not np.any(demonstrations.action == AGAINST)
    fit = sc.fit_mdce_serd(given.timed, demonstrations)
    gain = sc.expected_information_gain(sc.laplace(given.timed, demonstrations, fit))
    table = given.timed.mdp.transitions.local_probabilities(fit.parameters.truth)
    policy = sc.soft_policy(given.timed, fit.reward_weights, table).probabilities
    against = policy[:, AGAINST].reshape(PLACES, 2).mean(axis=1)
    best = int(np.argmax(gain.reshape(PLACES, 2).mean(axis=1)))
    assert against[best - 1] > 0.5 > against[best + 1]


def test_worlds_with_moves_against_the_stream_are_summed_up_apart():
    bias = np.arange(21.0)
    rows = {"case": "one", "repetition": np.arange(22), "size": 3, "learner": "two steps"}
    table = pd.DataFrame(rows | {"moves_against": [0] * 21 + [4], "bias": [*bias, 50.0]})
    found = summary_of(table).set_index(["avoided", "over worlds"])
    assert found.loc[True, "bias"].to_dict() == {"mean": 10.0, "5 %": 1.0, "95 %": 19.0}
    assert found.loc[False, "bias"].to_dict() == {"mean": 50.0, "5 %": 50.0, "95 %": 50.0}
    assert found.loc[True, "worlds"].tolist() == [21] * 3
    assert found.loc[False, "worlds"].tolist() == [1] * 3
