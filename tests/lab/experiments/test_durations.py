import numpy as np
import pytest

import serd_core as sc
from lab.experiments.durations import (
    AGAINST,
    CASES,
    PLACES,
    WITH,
    DurationsConfig,
    demonstrate,
    learn,
    world,
)

CONFIG = DurationsConfig(sizes=(10,), draws=32)


def test_the_best_way_is_against_the_stream_only_close_to_the_goal():
    for case in CASES:
        given = world(CONFIG, case)
        assert given.ways(given.timed, given.table) == [AGAINST, WITH, WITH]


def test_choices_inform_about_a_move_that_no_demonstration_has():
    given, rng = world(CONFIG, "one outcome"), np.random.default_rng(1)
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


@pytest.mark.parametrize("case", CASES)
def test_the_next_demonstration_starts_where_both_ways_are_as_good(case):
    """Experts never went against the stream, so from there they show how long that takes."""
    given = world(CONFIG, case)
    demonstrations = demonstrate(given, np.random.default_rng(2))
    assert not np.any(demonstrations.action == AGAINST)
    fit = sc.fit_mdce_serd(given.timed, demonstrations)
    gain = sc.expected_information_gain(sc.laplace(given.timed, demonstrations, fit))
    table = given.timed.mdp.transitions.local_probabilities(fit.parameters.truth)
    policy = sc.soft_policy(given.timed, fit.reward_weights, table).probabilities
    against = policy[:, AGAINST].reshape(PLACES, 2).mean(axis=1)
    best = int(np.argmax(gain.reshape(PLACES, 2).mean(axis=1)))
    assert against[best - 1] > 0.5 > against[best + 1]
