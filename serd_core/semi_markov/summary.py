"""What a fit found about dwell times, and the dynamics a robot plans with.

Of a move that nobody makes the choices reveal little more than mu / P, its mean dwell time over the
probability of its outcome: slow and unlikely outcomes are avoided alike. So log(mu / P) is given
with its own standard deviation, which can be far below that of log mu.

A robot plans with the posterior mean of K = P E[gamma^tau], in which Bellman's equation is linear;
the mode is biased where durations are uncertain. The largest of averaged Q-values is no plan: each
Q assumes that its own draw is known from then on.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, require_count, require_generator
from serd_core.bayes.laplace import Laplace, laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.problem import Problem
from serd_core.posterior.parameters import Block
from serd_core.semi_markov.models import ONE_SECOND, require_timed

#: Draws that the mean takes unless another number is asked for.
N_DRAWS = 64


@dataclass(frozen=True, eq=False)
class DwellSummary:
    """Of one block of parameters, with M models, K outcomes and D laws.

    outcome_probabilities: (M, K); mean_s, shape: (D,) at the pace 0.
    log_mean_deviation: (D,) posterior standard deviation of log mean_s.
    log_mean_over_probability, its_deviation: (M, K) log(mean_s / P) of each outcome and its
    posterior standard deviation; NaN for outcomes without a law.
    n_chosen: (M,) decisions in which each model was chosen.
    weight_correlation: (F, D) posterior correlation of reward weights and log means: near 1 or -1
    the demonstrations cannot distinguish a dislike of moves from their slowness.
    """

    outcome_probabilities: FloatArray
    mean_s: FloatArray
    shape: FloatArray
    log_mean_deviation: FloatArray
    log_mean_over_probability: FloatArray
    its_deviation: FloatArray
    n_chosen: FloatArray
    weight_correlation: FloatArray


def dwell_summary(
    problem: Problem, decisions: Decisions, fit: FitResult, block: Block = Block.TRUTH
) -> DwellSummary:
    """Laws of dwell times of a fit by `PriorByEvidence`, and what is known of them.

    block: of the world, or `Block.BELIEF`. SerdError where moves of the problem take no time, or
    the prior of the fit is no density. Deviations are those of Laplace's approximation.

        laws = sc.dwell_summary(timed, decisions, fit)
        unseen = laws.n_chosen == 0
        print(laws.log_mean_over_probability[unseen], laws.its_deviation[unseen])
    """
    model = require_timed(problem.mdp.transitions)
    found, theta = laplace(problem, decisions, fit), fit.parameters.block(block)
    jacobian = found.coordinates.belief.jacobian(fit.parameters)
    spread = jacobian @ found.coordinates.table @ found.root
    weights, dynamics = (
        spread[fit.parameters.place(Block.REWARD)],
        spread[fit.parameters.place(block)],
    )
    outcomes = model.outcomes.local_probabilities(theta)
    law, has_law = model.law_of.ravel(), model.law_of.ravel() != ONE_SECOND
    slopes = -model.outcomes.local_jacobian(theta) / outcomes.reshape(-1, 1)
    slopes[np.flatnonzero(has_law), model.means.start + law[has_law]] += 1.0
    means, laws = theta[model.means], dynamics[model.means]
    ratio = np.append(means, np.nan)[law] - np.log(outcomes.ravel())
    deviation = np.where(has_law, np.linalg.norm(slopes @ dynamics, axis=1), np.nan)
    lengths = np.outer(np.linalg.norm(weights, axis=1), np.linalg.norm(laws, axis=1))
    shown = decisions.select(~decisions.hidden)
    chosen = model.row_model[model.model_of[shown.state, shown.action]]
    return DwellSummary(
        outcome_probabilities=outcomes,
        mean_s=np.exp(means),
        shape=np.exp(theta[model.shapes]),
        log_mean_deviation=np.linalg.norm(laws, axis=1),
        log_mean_over_probability=ratio.reshape(outcomes.shape),
        its_deviation=deviation.reshape(outcomes.shape),
        n_chosen=np.bincount(chosen, minlength=len(outcomes)).astype(np.float64),
        weight_correlation=(weights @ laws.T) / np.maximum(lengths, np.finfo(np.float64).tiny),
    )


def dynamics_draws(
    found: Laplace, rng: np.random.Generator, n: int = N_DRAWS, block: Block = Block.TRUTH
) -> FloatArray:
    """(n, N) posterior draws of dynamics parameters, by exact sweeps where moves take time.

    block: of the world, or `Block.BELIEF` for what the expert expects.

        found = sc.laplace(timed, decisions, fit)
        draws = sc.dynamics_draws(found, np.random.default_rng(0))
        laws = timed.mdp.transitions.laws(draws)    # (n, R, K) outcomes, means and shapes
    """
    require_count("n", n, 2, f"{N_DRAWS}")
    require_generator(rng)
    space = found.coordinates
    return np.stack([space.parameters(u).block(block) for u in found.sample(n, rng)])


def mean_discounted_outcomes(problem: Problem, draws: FloatArray) -> FloatArray:
    """(R, K) mean of K / gamma over (n, N) posterior draws, with which a robot plans.

    problem: that of the posterior, or one with the same models and laws elsewhere (another goal or
    pace). SerdError where its moves take no time.

        table = sc.mean_discounted_outcomes(timed, draws)
        robot = sc.optimal_policy(timed, fit.reward_weights, table)
    """
    model = require_timed(problem.mdp.transitions)
    return np.asarray(model.local_probabilities(draws).mean(axis=0))
