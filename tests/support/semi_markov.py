"""A small ring with a stream, in which moves take time."""

import numpy as np

import serd_core as sc

PLACES, GOAL = 12, 0
WITH, AGAINST, WAIT = range(3)
OUTCOMES = np.array([[0.9, 0.06, 0.04], [0.85, 0.1, 0.05], [0.7, 0.2, 0.1]])
MEAN_S = np.array([1.0, 3.0, 0.8])
WEIGHTS = np.array([4.0, 0.3])
#: Each model has a law of its own; or outcomes that share successors have several; or staying takes
#: a given time.
LAWS = {
    "of models": None,
    "of outcomes": np.array([[0, 1, 1], [2, 3, 2], [4, 4, 1]]),
    "and patience": np.array([[0, 0, 1], [2, 2, 3], [4, 4, 4]]),
}
#: Kind of laws, and whether places have paces.
CASES = [("of models", True), ("of outcomes", False), ("and patience", True)]
STAYS = {"of models": None, "of outcomes": None, "and patience": np.array([4.0, 4.0, 1.5])}


def ring(discount=0.97, n_outcomes=3):
    """The problem in which moves take no time: outcomes forward, stay, back; WAIT drifts."""
    state = np.arange(PLACES)
    onward, back = (state + 1) % PLACES, (state - 1) % PLACES
    rows = [(onward, state, back), (back, state, onward), (state, state, onward)]
    successors = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    successors[GOAL] = GOAL
    available = np.ones((PLACES, len(rows)), dtype=np.bool_)
    available[GOAL, :WAIT] = False
    successors = successors[:, :, :n_outcomes]
    models = sc.OutcomeModels(successors, np.tile(np.arange(3), (PLACES, 1)), available, 3)
    features = np.zeros((PLACES, len(rows), 2))
    features[GOAL, :, 0] = 1.0
    features[:, WITH, 1], features[:, AGAINST, 1] = 1.0, -1.0
    features[GOAL, :, 1] = 0.0
    return sc.TabularProblem(sc.Mdp(models, discount), features, ("goal", "norm"))


def timed_ring(laws="of models", log_pace=None, discount=0.97):
    """The same with dwell times, and its true parameters."""
    timed = sc.semi_markov_problem(
        ring(discount), law_of=LAWS[laws], stay_s=STAYS[laws], log_pace=log_pace
    )
    models = timed.mdp.transitions
    means = MEAN_S if laws == "of models" else np.array([1.0, 2.0, 3.0, 4.0, 0.8])
    return timed, models.parameters_from(OUTCOMES, means, 5.0)


def demonstrations(timed, truth, rng, *, n_episodes=12, until_command_s=3.0, starts=None):
    """Episodes of an expert who knows the ring, some decisions censored by another command."""
    table = timed.mdp.transitions.local_probabilities(truth)
    starts = np.arange(1, PLACES) if starts is None else starts
    share = np.zeros(PLACES)
    share[starts] = 1.0 / len(starts)
    return sc.sample_timed_decisions(
        timed.mdp,
        sc.soft_policy(timed, WEIGHTS[: len(timed.feature_names)], table).probabilities,
        truth,
        share,
        n_episodes=n_episodes,
        n_steps=60,
        rng=rng,
        mean_until_command_s=until_command_s,
    )
