import numpy as np

from lab.experiments.durations import (
    AGAINST,
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
