"""Maximum discounted causal entropy IRL under given dynamics (section 3.2.3).

By likelihood (3.33): maximise sum log pi_theta(a | s) of the observed choices.

By entropy (3.24 to 3.27, 3.34): match discounted feature expectations,

    J(theta) = theta . phi~ + E[gamma^T V_theta(s_T)] - E_{s0}[V_theta(s0)]
    dJ/dtheta = phi~ + E[gamma^T phi(pi_theta | s_T)] - phi(pi_theta)                      (3.34)

s_T is the state after the T decisions of an episode that was cut off: what it would have collected
from there is expected under the policy. (3.34) has infinite episodes and lacks that term. Feature
counts are *discounted*, as in the constraint; matching them undiscounted gives a wrong reward.
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import LBFGS, Ascent, StepCallback
from serd_core.ascent.trust_region import TrustRegion
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.bellman.bellman_solver import policy_system
from serd_core.demonstrations.decisions import Decisions, start_distribution
from serd_core.demonstrations.simulation import cut_off_ends, feature_counts
from serd_core.dynamics.transition_model import Transitions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import UNIFORM, fit_mdce_serd
from serd_core.learners.start import reward_search
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.beliefs import FixedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import GaussianPrior, Prior, require_weight


def fit_mdce_irl_by_likelihood(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    prior: Prior | PriorByEvidence = UNIFORM,
    ascent: Ascent = LBFGS,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn the reward weights of a soft expert whose dynamics are known, by likelihood.

    The policy is that of maximum discounted causal entropy (3.28); with `prior=PriorByEvidence()`
    the weights are those of highest posterior, which are finite even if all decisions agree.

    initial_weights: (F,) to start from; None draws them from U[-10, 10] by `rng`, which must then
    be given.
    dynamics: (M, K) outcome probabilities, or parameters of timed ones, taken as known; None
    estimates them from the decisions. They may hold zeros where no decision contradicts these.
    prior: of the weights; `UniformPrior()` for the most likely ones.
    ascent: what climbs (`Lbfgs`, `TrustRegion`); on_step: as in `fit_mdce_serd`.
    Returns a `FitResult`; raises SerdError where an argument is wrong or a decision is impossible.

        fit = sc.fit_mdce_irl_by_likelihood(problem, decisions, prior=sc.PriorByEvidence())
    """
    return fit_mdce_serd(
        problem,
        decisions,
        initial_weights=initial_weights,
        rng=rng,
        dynamics=dynamics,
        belief=FixedBelief(),
        prior=prior,
        ascent=ascent,
        on_step=on_step,
    )


def fit_mdce_irl_by_entropy(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    slack: float = 0.0,
    ascent: Ascent = LBFGS,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn reward weights whose soft policy has the discounted features of the demonstrations.

    Maximises the dual of the causal entropy under matched features (section 3.2.3). Episodes that
    end in an absorbing state with one action count as staying there forever; others were cut off,
    and go on by the policy from their last state.

    initial_weights, rng, dynamics, ascent, on_step: as in `fit_mdce_irl_by_likelihood`.
    slack: lets feature averages differ by slack times the weights; without it the weights of few
    demonstrations may grow without bound, as no policy has their features.
    Returns a `FitResult`; raises SerdError for hidden actions and wrong arguments.

        fit = sc.fit_mdce_irl_by_entropy(problem, decisions, rng=rng, slack=0.001)
    """
    require_weight("slack", slack)
    search = reward_search(problem, decisions, MdcePolicy(), initial_weights, rng, dynamics)
    wanted = feature_counts(problem, decisions).mean(axis=0)
    starts = start_distribution(decisions, problem.mdp.n_states)
    starts = starts - cut_off_ends(problem, decisions)
    average = 1.0 - problem.mdp.discount
    # Near a discount of 1 averages hide what absorbed episodes count: tolerances are of the counts.
    scale = 1.0 / max(1.0, float(np.max(np.abs(search.scale * wanted))))

    def dual(weights: FloatArray) -> tuple[float, FloatArray]:
        """J, and the slack of averages, in units of the largest demonstrated feature count."""
        solution = search.solution(weights)
        visits = state_action_occupancy(problem.mdp, search.transitions, solution.policy, starts)
        expected = np.tensordot(visits, problem.features, axes=2)
        value = float(weights @ wanted - starts @ solution.value)
        penalty = 0.5 * slack / average * float(weights @ weights)
        gradient = wanted - expected - slack / average * weights
        return scale * (value - penalty), scale * gradient

    fix, n_observations = "allow some slack, for example 0.001", len(decisions.episodes) / scale
    return search.maximise(dual, ascent, on_step, fix, n_observations)


def state_action_occupancy(
    mdp: Mdp, transitions: Transitions, policy: FloatArray, starts: FloatArray
) -> FloatArray:
    """(S, A) expected discounted visits of an (S, A) policy, linear in its (S,) starts."""
    system = policy_system(transitions, policy, mdp.discount)
    return np.asarray(system.solve(starts, transposed=True)[:, None] * policy)


#: Wide, but enough to keep weights finite where every demonstration agrees.
_WIDE = GaussianPrior(100.0, Block.REWARD)
_ASCENT = TrustRegion(gradient_tolerance=1e-5)


def weights_under_initial_dynamics(
    problem: Problem,
    decisions: Decisions,
    *,
    dynamics: FloatArray | None = None,
    on_step: StepCallback | None = None,
) -> FloatArray:
    """(F,) most likely weights under the given dynamics (None: the M-estimate), from zero.

    A start for SERD. From random weights it may bend the dynamics to a wrong reward and stay there;
    with few demonstrations that happened to about one start in four on the gridworld. Where the
    search does not converge its last point is returned. on_step: called after each step.
    """
    fit = fit_mdce_irl_by_likelihood(
        problem,
        decisions,
        initial_weights=np.zeros(len(problem.feature_names)),
        dynamics=dynamics,
        prior=_WIDE,
        ascent=_ASCENT,
        on_step=on_step,
    )
    return fit.reward_weights
