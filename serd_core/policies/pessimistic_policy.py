"""The policy that avoids what is not known: plans by a low quantile over draws of the dynamics.

    Q(s, a) = R(s, a) + discount quantile_i sum_k P^i_m(k) V(s'),    V(s) = max_a Q(s, a)

P^1, ..., P^n are draws of the posterior. A quantile of monotone functions of V is monotone, and a
constant added to V passes through it, discounted. So the right-hand side is a contraction, as for
the minimum (Iyengar, Mathematics of Operations Research 30, 2005), and value iteration converges.
Each state and action has a quantile of its own, as if its draw were independent of the others.
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.checks import float_array, require_memory, require_share
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.solved_policy import Policy, optimal_policy

#: Of the largest value: where value iteration ends, and what counts as equally good.
TOLERANCE, EQUAL = 1e-8, 1e-6


def pessimistic_policy(
    problem: Problem,
    reward_weights: FloatArray,
    outcome_probabilities: FloatArray,
    quantile: float,
) -> Policy:
    """Solve for the policy that plans by a quantile over draws of what each decision leads to.

    reward_weights: (F,); outcome_probabilities: (n, M, K) draws, of `laplace_draws` for example;
    quantile: above 0 and below 1, 0.1 to avoid what is not known. Result as in `optimal_policy`,
    with lower values. SerdError for other shapes.

        draws = sc.laplace_draws(found, rng).outcome_probabilities
        policy = sc.pessimistic_policy(problem, fit.reward_weights, draws, 0.1)
    """
    require_problem(problem)
    require_share("quantile", quantile, "0.1")
    models, mdp = problem.mdp.transitions, problem.mdp
    if not isinstance(models, OutcomeModels):
        raise SerdError(
            f"problem must have outcome models, of which draws differ, got {type(models).__name__};"
            " use optimal_policy for known transitions"
        )
    shape = (None, models.n_models, models.n_outcomes)
    tables = float_array("outcome_probabilities", outcome_probabilities, shape)
    start = optimal_policy(problem, reward_weights, tables.mean(axis=0))
    n_bytes = 16.0 * len(tables) * models.successors.size
    require_memory(f"outcomes of {len(tables)} draws by pair", n_bytes, "take fewer draws")
    reward = np.where(models.available, problem.features @ np.asarray(reward_weights), -np.inf)
    by_pair = tables[:, np.where(models.available, models.model_of, 0)]
    successors = np.where(models.available[:, :, None], models.successors, 0)
    place = int(np.ceil(quantile * len(tables))) - 1
    value, change, share = start.value, np.inf, mdp.discount / (1.0 - mdp.discount)
    while share * change > TOLERANCE * max(1.0, float(np.abs(value).max())):
        ahead = np.einsum("nsak,sak->nsa", by_pair, value[successors])
        q = reward + mdp.discount * np.partition(ahead, place, axis=0)[place]
        better = q.max(axis=1)
        change, value = float(np.abs(better - value).max()), better
    equal = q >= value[:, None] - EQUAL * max(1.0, float(np.abs(value).max()))
    probabilities = equal / equal.sum(axis=1, keepdims=True)
    greedy = q.argmax(axis=1)
    return Policy(value, q, probabilities, greedy, change, share * change, converged=True)
