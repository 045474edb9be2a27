import numpy as np

from lab.experiments.durations import (
    AGAINST,
    WITH_PLACES,
    DurationsConfig,
    demonstrate,
    learn,
    world,
)

CONFIG = DurationsConfig(sizes=(10,), draws=32)


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
