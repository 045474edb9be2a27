"""Sample demonstrations of decisions that take time."""

from typing import Any

import numpy as np

from serd_core.arrays import FloatArray, float_array, require_count, require_generator, require_kind
from serd_core.mdp.mdp import Mdp, checked_distribution, checked_policy
from serd_core.semi_markov.models import require_timed
from serd_core.semi_markov.timed_decisions import TIMED_COLUMNS, TimedDecisions

#: Shortest dwell time (s).
SHORTEST_S = 1e-6


def sample_timed_decisions(
    mdp: Mdp,
    policy: FloatArray,
    parameters: FloatArray,
    start_distribution: FloatArray,
    *,
    n_episodes: int,
    n_steps: int,
    rng: np.random.Generator,
    mean_until_command_s: float = np.inf,
    source: str = "sampled",
) -> TimedDecisions:
    """Episodes of at most `n_steps` decisions; one ends in a final state (`Mdp.final`).

    policy: (S, A); parameters: (N,) of the dynamics (`SemiMarkovModels.parameters_from`);
    start_distribution: (S,). mean_until_command_s: mean of the exponential time after which another
    command ends a decision that has no outcome yet, and the policy decides anew in the same state;
    inf for never.

        truth = timed.mdp.transitions.parameters_from(table, mean_s=[1.0, 3.0], shape=6.0)
        table = timed.mdp.transitions.local_probabilities(truth)
        policy = sc.soft_policy(timed, weights, table).probabilities
        decisions = sc.sample_timed_decisions(
            timed.mdp, policy, truth, starts, n_episodes=10, n_steps=99, rng=rng)
    """
    require_kind("mdp", mdp, (Mdp,), "problem.mdp")
    require_count("n_episodes", n_episodes, 1, "100")
    require_count("n_steps", n_steps, 1, "50")
    require_generator(rng)
    model = require_timed(mdp.transitions)
    choice = checked_policy("policy", policy, mdp)
    starts = checked_distribution("start_distribution", start_distribution, mdp.n_states)
    laws = model.laws(float_array("parameters", parameters, (model.n_parameters,)))
    given = np.isinf(laws.shape)
    rows: list[tuple[Any, ...]] = []
    for episode in range(n_episodes):
        state, now = int(rng.choice(mdp.n_states, p=starts)), 0.0
        for _ in range(n_steps):
            if mdp.final[state]:
                break
            action = int(rng.choice(mdp.n_actions, p=choice[state] / choice[state].sum()))
            row = model.model_of[state, action]
            outcome = int(rng.choice(model.n_outcomes, p=laws.probability[row]))
            dwell = mean_s = laws.mean_s[row, outcome]
            if not given[row, outcome]:
                shape = laws.shape[row, outcome]
                dwell = max(float(rng.gamma(shape, mean_s / shape)), SHORTEST_S)
            until = dwell
            if np.isfinite(mean_until_command_s):
                until = max(float(rng.exponential(mean_until_command_s)), SHORTEST_S)
            censored, lasted = until < dwell, min(until, dwell)
            following = state if censored else int(model.successors[state, action, outcome])
            rows.append((episode, now, state, action, following, lasted, censored))
            state, now = following, now + lasted
    table = list(zip(*rows, strict=True)) or [()] * len(TIMED_COLUMNS)
    columns: dict[str, Any] = dict(zip(TIMED_COLUMNS, map(np.array, table), strict=True))
    return TimedDecisions(**columns, source=source)
