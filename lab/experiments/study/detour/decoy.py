"""Does SERD follow a truth that demonstrations never show? The decoy of the detour study.

P(forward | against) of the measured dynamics is replaced by another value. Experts who know it
demonstrate in the decision problem, all episodes of a set from one cell that is drawn at random.
From some the goal lies ahead, so no choice bears on moves against the flow.
"""

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.detour.fits import REWARDS
from lab.experiments.study.detour.settings import DetourStudy
from lab.experiments.study.recordings.reference import reference_dynamics
from serd_core.arrays import FloatArray
from serd_core.bayes.information import outcome_information
from serd_core.bayes.laplace import laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import AGAINST_FLOW, FEATURE_NAMES, NavigationProblem
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import soft_policy
from serd_sim.scenario.grid import navigation_problem_of

PLACE = (AGAINST_FLOW, Outcome.FORWARD)
#: Mass of the posterior's interval.
MASS = 0.9
LONGEST = 200


def decoy_row(study: DetourStudy, number: int, repetition: int) -> Row:
    """Demonstrate by the truth of that number, and learn."""
    decoy = study.settings.decoy
    weights = dict(zip(FEATURE_NAMES, study.settings.expert_weights, strict=True))
    rng = np.random.default_rng([study.settings.seed, 7, number, repetition])
    features = REWARDS["goal and wall"]
    problem = navigation_problem_of(study.scenario, study.settings.discount, features)
    truth = with_forward(reference_dynamics(study), decoy.truths[number])
    policy = soft_policy(problem, np.array([weights[name] for name in features]), truth)
    starts = np.zeros(problem.grid.n_states)
    starts[rng.choice(np.setdiff1d(np.arange(len(starts)), problem.goal_states))] = 1.0
    size = int(rng.choice(decoy.sizes))
    decisions = sample_decisions(
        problem.mdp, policy.probabilities, truth, starts, n_episodes=size, n_steps=LONGEST, rng=rng
    )
    place = {"truth": decoy.truths[number], "repetition": repetition, "size": size}
    return place | posterior_row(problem, decisions)


def with_forward(dynamics: FloatArray, forward: float) -> FloatArray:
    """(M, K) the same with another P(forward | against); the rest of the row in proportion."""
    table = dynamics.copy()
    table[PLACE] = 0.0
    table[AGAINST_FLOW] *= (1.0 - forward) / table[AGAINST_FLOW].sum()
    table[PLACE] = forward
    return table


def posterior_row(problem: NavigationProblem, decisions: Decisions) -> Row:
    """P(forward | against) by the default of SERD, with its interval and information."""
    try:
        fit = fit_mdce_serd(problem, decisions)
        known = outcome_information(laplace(problem, decisions, fit), MASS)
    except SerdError as error:
        return {"converged": False, "message": str(error)}
    return {
        "converged": fit.converged,
        "message": fit.message,
        "moves": float(known.n_decisions[AGAINST_FLOW]),
        **{end: float(getattr(known, end)[PLACE]) for end in ("lower", "median", "upper")},
        "from_choices": float(known.from_choices[AGAINST_FLOW]),
    }
