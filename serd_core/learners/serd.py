"""The unified SERD algorithm (Algorithm 1): rewards and dynamics at once, by MAP estimation.

The gradient is that of the thesis, by adjoint instead of Q-gradient recursion. Decisions whose
action is `HIDDEN` count by the likelihood of their states alone (docs/hidden_actions.md).

MDCE SERD (section 4.4.1) has the maximum discounted causal entropy policy. PM SERD (section 4.4.2)
has a Boltzmann policy over optimal Q-values, whose temperature theta_P is learned as well.
Demonstrations determine the ratio of rewards and theta_P only: a prior that holds theta_P near a
value fixes the scale and does not change the likelihood; without one a fit does not converge.
"""

from dataclasses import replace

import numpy as np

from serd_core.arrays import FloatArray, described
from serd_core.ascent.ascent import LBFGS, Ascent, StepCallback
from serd_core.ascent.kinked import KinkedAscent
from serd_core.bayes.strengths import PriorByEvidence, fit_by_evidence
from serd_core.checks import require_kind, require_positive
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.learners.certificate import certificate
from serd_core.learners.fit_result import Assumptions, FitResult, fit_result
from serd_core.learners.start import (
    TIED,
    dynamics_or_estimate,
    initial_weights_or_sample,
    reward_names,
    starting_parameters,
)
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import MdcePolicy, PolicyMatchingPolicy, PolicyModel
from serd_core.posterior.beliefs import Belief, FixedBelief
from serd_core.posterior.coordinates import LogPosterior, free_numbers
from serd_core.posterior.hessian import idle_weights
from serd_core.posterior.posterior import Posterior, require_possible
from serd_core.priors.divergence import require_outcome_models
from serd_core.priors.prior import Prior, UniformPrior

UNIFORM, BY_EVIDENCE = UniformPrior(), PriorByEvidence()
KINKED = KinkedAscent()


def fit_serd(
    problem: Problem,
    decisions: Decisions,
    policy_model: PolicyModel,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    belief: Belief = TIED,
    prior: Prior | PriorByEvidence = UNIFORM,
    ascent: Ascent = LBFGS,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn reward weights and dynamics by Algorithm 1 for any policy model."""
    for name, part, kinds, example in (
        ("belief", belief, (Belief,), "FreeBelief()"),
        ("prior", prior, (Prior, PriorByEvidence), "GaussianPrior(1.0, Block.REWARD)"),
        ("ascent", ascent, (Ascent,), "Lbfgs()"),
    ):
        require_kind(name, part, kinds, example)
    observations, model = observe(problem, decisions), problem.mdp.transitions
    weights = initial_weights
    if isinstance(prior, PriorByEvidence):
        if not model.n_parameters:
            belief = FixedBelief()  # there are no dynamics to learn, or to have a prior
        elif belief.learns_dynamics:
            require_outcome_models(model, "PriorByEvidence")
        if weights is None:
            weights = np.zeros(len(problem.feature_names))
    weights = initial_weights_or_sample(problem, weights, rng)
    given = dynamics_or_estimate(problem, decisions, dynamics, learned=belief.learns_dynamics)
    start = starting_parameters(problem, policy_model, weights, given, belief)
    local = model.moves.local_probabilities
    require_possible(observations, problem.mdp, local(start.truth))
    posterior = Posterior(problem, observations, policy_model, UNIFORM)
    undetermined: tuple[str, ...] = ()
    open_strengths: tuple[str, ...] = ()
    if isinstance(prior, PriorByEvidence):
        staged = initial_weights is None
        open_strengths = prior.strengths(belief, model).open
        found = fit_by_evidence(posterior, belief, prior, start, on_step, staged=staged)
        objective, parameters, ascended = found
        prior = objective.posterior.prior
    else:
        whole_prior = (prior + belief.prior).anchored(local(start.truth))
        posterior = replace(posterior, prior=whole_prior)
        space, n_decisions = free_numbers(problem, belief, start), observations.n_decisions
        objective = LogPosterior(posterior, space, divisor=n_decisions)
        ended = ascent.maximise(objective, belief.pack(start), on_step)
        reached = belief.unpack(ended.vector, start)
        parameters, ended, undetermined = certificate(posterior, belief, reached, ended, on_step)
        ascended = replace(ended, objective_trace=ended.objective_trace * n_decisions)
    final = objective.at(parameters)
    assumptions = Assumptions(
        policy_model, belief, prior, by_likelihood=True, open_strengths=open_strengths
    )
    ascended = replace(ascended, objective=final.objective)
    if ascended.converged and not undetermined:
        idle = idle_weights(posterior, parameters, final)
        undetermined = tuple(described(each, reward_names(problem)) for each in idle)
        if undetermined:
            message = f"{ascended.message}; the prior alone determines {'; '.join(undetermined)}"
            ascended = replace(ascended, message=message)
    tables = local(parameters.truth), local(parameters.belief), local(start.truth)
    return fit_result(posterior, assumptions, parameters, final, ascended, tables, undetermined)


def fit_mdce_serd(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    belief: Belief = TIED,
    prior: Prior | PriorByEvidence | None = None,
    ascent: Ascent | None = None,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn reward weights and dynamics at once from the decisions of a soft expert (Algorithm 1).

    Maximises J = sum log pi(a | s) + sum log P(s' | s, a) + log prior (4.9). pi is the policy of
    maximum discounted causal entropy (3.28) under the dynamics that the expert believes in (section
    4.4.1). Weights are in units of one over their feature. Decisions whose action is `HIDDEN` count
    by their states.

    problem: with F features and M outcome models of K outcomes (`TabularProblem`).
    initial_weights: (F,) to start from; None starts at 0 with a prior by evidence, and else draws
    from U[-10, 10] by `rng`, which must then be given.
    dynamics: (M, K) probabilities to start from, or the parameters of timed ones; None for the
    M-estimate of the decisions. With `FixedBelief()` they are known and stay as they are.
    belief: how what the expert believes of the dynamics relates to the truth: `TiedBelief()` (they
    know it), `FixedBelief()`, `FreeBelief()`, `CoupledBelief(weight)`.
    prior: None for `PriorByEvidence()`, proper priors whose strengths the decisions choose; a sum
    of others such as `GaussianPrior(2.0, Block.REWARD)`; `UniformPrior()` for the most likely
    parameters, which is also the default where an `ascent` is given.
    ascent: `Lbfgs()` or `TrustRegion()`; a prior by evidence has its own.
    on_step: called after each step with a record of its `number`, `objective` (J per decision),
    `gradient_norm`, `n_evaluations` and `vector`; returning True stops the fit.

    Returns a `FitResult`: `reward_weights` (F,), `outcome_probabilities` (M, K), `converged`, and
    why not. Raises SerdError where an argument is wrong, or an observed move is impossible.

        fit = sc.fit_mdce_serd(problem, decisions)
        print(dict(zip(fit.feature_names, fit.reward_weights)), fit.message)
    """
    if prior is None:
        prior = BY_EVIDENCE if ascent is None else UNIFORM
    return fit_serd(
        problem,
        decisions,
        MdcePolicy(),
        initial_weights=initial_weights,
        rng=rng,
        dynamics=dynamics,
        belief=belief,
        prior=prior,
        ascent=ascent or LBFGS,
        on_step=on_step,
    )


def fit_pm_serd(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    initial_temperature: float = 1.0,
    belief: Belief = TIED,
    prior: Prior = UNIFORM,
    ascent: Ascent = KINKED,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn rewards, dynamics and temperature of an expert who knows the optimal Q-values.

    The expert follows the Boltzmann policy pi(a | s) ~ exp(Q*(s, a) / theta_P) (section 4.4.2).
    Scaling all rewards and theta_P by one factor changes nothing, so a fit converges only with a
    prior that holds one of them, as in the example.

    problem, decisions, dynamics, belief, on_step: as in `fit_mdce_serd`.
    initial_weights: (F,) to start from; None draws them from U[-10, 10] by `rng`.
    initial_temperature: theta_P to start from; prior: `UniformPrior()` for none.
    ascent: `KinkedAscent()`, as J has kinks where the greedy policy changes, and most maxima lie on
    one; smooth ascents stop there and report that they did not converge.

    Returns a `FitResult`, whose `temperature` is theta_P. Raises SerdError as `fit_mdce_serd` does.

        prior = sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0)
        fit = sc.fit_pm_serd(problem, decisions, rng=np.random.default_rng(0), prior=prior)
    """
    require_positive("initial_temperature", initial_temperature)
    return fit_serd(
        problem,
        decisions,
        PolicyMatchingPolicy(start_temperature=initial_temperature),
        initial_weights=initial_weights,
        rng=rng,
        dynamics=dynamics,
        belief=belief,
        prior=prior,
        ascent=ascent,
        on_step=on_step,
    )
