"""The learning methods of the product, by name, and what they learn from.

Where a weight has to be chosen (of the divergence prior or of the coupling), it is the one of the
highest likelihood on the validation episodes; the result is then fitted to all episodes, so every
method learns from the same demonstrations.

SERD starts in two stages: reward weights under the M-estimate of the dynamics first, then both.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from serd_app.errors import AppError
from serd_app.learning.settings import MethodName, RecipeSettings
from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Step
from serd_core.ascent.trust_region import TrustRegion
from serd_core.bayes.strengths import strengths_of
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.navigation import FEATURE_NAMES, NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import (
    fit_mdce_irl_by_likelihood,
    weights_under_initial_dynamics,
)
from serd_core.learners.serd import fit_mdce_serd
from serd_core.learners.start import dynamics_of_hidden_actions
from serd_core.posterior.beliefs import Belief, CoupledBelief, FreeBelief, TiedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.prior import GaussianPrior, Prior
from serd_core.selection.evaluation import select_weight, split_episodes, validation_log_likelihood

ASCENT = TrustRegion(gradient_tolerance=1e-5, max_steps=200)
#: Methods that accept decisions whose action is hidden.
LEARN_FROM_STATES: tuple[MethodName, ...] = (
    "mdce_serd_evidence",
    "mdce_serd_coupled",
    "mdce_serd_free",
)


@dataclass(frozen=True, eq=False)
class FitProgress:
    """A step of fit `number` of `total`; prior_weight: the one it uses, None for methods without.

    The last fit is the one to all episodes, those before compare weights on validation.
    n_features: F, of a place with flow by default.
    """

    number: int
    total: int
    prior_weight: float | None
    step: Step
    n_features: int = len(FEATURE_NAMES)

    @property
    def weights(self) -> FloatArray:
        """(F,) reward weights, with which the vector of every method begins."""
        return self.step.vector[: self.n_features]

    @property
    def is_last(self) -> bool:
        """Whether it is the fit to all episodes."""
        return self.number == self.total


ProgressCallback = Callable[[FitProgress], None]
OnStep = Callable[[Step], None]


def ignore_progress(progress: FitProgress) -> None:
    """A ProgressCallback that does nothing."""


@dataclass(frozen=True, eq=False)
class FitData:
    """Demonstrations to learn from, and how they are split to choose a weight.

    decisions: all of them; validation: empty where there is one episode, which is all of training.
    initial_weights: (F,) where SERD starts, None for the start in two stages.
    """

    problem: NavigationProblem
    settings: RecipeSettings
    decisions: Decisions
    training: Decisions
    validation: Decisions
    rng: np.random.Generator
    initial_weights: FloatArray | None = None
    on_progress: ProgressCallback = ignore_progress
    # A fit for every candidate weight starts from the same weights.
    _starts: dict[Decisions, FloatArray] = field(default_factory=dict, init=False, repr=False)

    @property
    def reward_prior(self) -> Prior:
        """Keeps reward weights finite where few demonstrations show one action only."""
        return GaussianPrior(self.settings.reward_deviation, Block.REWARD)

    def estimate(self, decisions: Decisions) -> FloatArray:
        """(M, K) M-estimate of the dynamics."""
        return estimate_dynamics(self.problem, decisions, self.settings.pseudo_count)

    def start_dynamics(self, decisions: Decisions) -> FloatArray:
        """(M, K) where SERD starts: the M-estimate, and where actions are hidden its substitute."""
        if decisions.hidden.any():
            return dynamics_of_hidden_actions(self.problem, decisions)
        return self.estimate(decisions)

    def start(self, decisions: Decisions, on_step: OnStep | None) -> FloatArray:
        """(F,) reward weights SERD starts from; on_step: called after each step of the search."""
        if self.initial_weights is not None:
            return self.initial_weights
        if decisions not in self._starts:
            self._starts[decisions] = weights_under_initial_dynamics(
                self.problem, decisions, dynamics=self.start_dynamics(decisions), on_step=on_step
            )
        return self._starts[decisions]

    def reporter(
        self, number: int = 1, total: int = 1, prior_weight: float | None = None
    ) -> OnStep:
        """What one fit calls after each step."""
        n_features = len(self.problem.feature_names)
        return lambda step: self.on_progress(
            FitProgress(number, total, prior_weight, step, n_features)
        )


def fit_data(
    problem: NavigationProblem,
    decisions: Decisions,
    settings: RecipeSettings,
    rng: np.random.Generator,
    initial_weights: FloatArray | None = None,
    on_progress: ProgressCallback = ignore_progress,
) -> FitData:
    """Split the episodes at random; a single one is not split."""
    parts = decisions, decisions.select_episodes([])
    if len(decisions.episodes) > 1:
        parts = split_episodes(decisions, settings.validation_share, rng)
    return FitData(problem, settings, decisions, *parts, rng, initial_weights, on_progress)


@dataclass(frozen=True, eq=False)
class MethodResult:
    """The fit to all episodes; prior: what it assumed, in words.

    prior_weight: the weight it used, None for methods without; validation: log-likelihood per
    validation decision of each candidate weight, empty where none was chosen.
    """

    fit: FitResult
    prior: str
    prior_weight: float | None = None
    validation: tuple[tuple[float, float], ...] = ()


def mdce_serd(data: FitData) -> MethodResult:
    """MDCE SERD, belief and truth tied."""
    return _with_best_weight(data, fit_tied, "KLD to the M-estimate")


def mdce_serd_evidence(data: FitData) -> MethodResult:
    """MDCE SERD, belief and truth tied, with the prior of highest evidence: all episodes train."""
    fit = fit_mdce_serd(
        data.problem, data.decisions, initial_weights=data.initial_weights, on_step=data.reporter()
    )
    return MethodResult(fit, _described(fit, data.problem))


def mdce_serd_coupled(data: FitData) -> MethodResult:
    """MDCE SERD, belief coupled to the truth."""

    def fit(data: FitData, decisions: Decisions, weight: float, on_step: OnStep) -> FitResult:
        prior = _uniform_on_both(data)
        return _fit_serd(data, decisions, CoupledBelief(weight), prior, on_step)

    return _with_best_weight(data, fit, "KLD between belief and truth")


def mdce_serd_free(data: FitData) -> MethodResult:
    """MDCE SERD, belief independent of the truth."""
    prior = _uniform_on_both(data)
    fit = _fit_serd(data, data.decisions, FreeBelief(), prior, data.reporter())
    return MethodResult(fit, _serd_prior(data))


def mdce_irl(data: FitData) -> MethodResult:
    """MDCE IRL by likelihood under the M-estimate."""
    return MethodResult(fit_rewards(data, data.estimate(data.decisions)), _normal(data))


def fit_by(method: MethodName, data: FitData) -> MethodResult:
    """Fit with a method; AppError where it cannot learn from such decisions."""
    if method not in LEARN_FROM_STATES and data.decisions.hidden.any():
        raise AppError(
            f"method must be one of {', '.join(LEARN_FROM_STATES)} where actions are hidden, got"
            f" {method}, which counts actions; take {LEARN_FROM_STATES[0]}, or as action the motion"
            " by action_from: motion in a mapping of 'serd demos'"
        )
    return METHODS[method](data)


METHODS: dict[MethodName, Callable[[FitData], MethodResult]] = {
    "mdce_serd": mdce_serd,
    "mdce_serd_evidence": mdce_serd_evidence,
    "mdce_serd_coupled": mdce_serd_coupled,
    "mdce_serd_free": mdce_serd_free,
    "mdce_irl": mdce_irl,
}


def fit_tied(
    data: FitData, decisions: Decisions, prior_weight: float, on_step: OnStep | None = None
) -> FitResult:
    """MDCE SERD: one model is what the expert believes and what is true."""
    uniform = uniform_prior(data.problem, Block.TRUTH, data.settings.pseudo_count)
    return _fit_serd(data, decisions, TiedBelief(), KldPrior(prior_weight) + uniform, on_step)


def fit_rewards(data: FitData, dynamics: FloatArray) -> FitResult:
    """MDCE IRL by likelihood under the given (M, K) dynamics."""
    return fit_mdce_irl_by_likelihood(
        data.problem,
        data.decisions,
        initial_weights=np.zeros(len(data.problem.feature_names)),
        dynamics=dynamics,
        prior=data.reward_prior,
        ascent=ASCENT,
        on_step=data.reporter(),
    )


def uniform_prior(problem: NavigationProblem, block: Block, pseudo_count: float) -> KldPrior:
    """The M-estimate's uniform prior on one block of dynamics; models that act nowhere have none.

    The M-estimator adds c pseudo-observations to every outcome, log P(theta) = c sum_{m,k} log
    P_m(k). That is the divergence prior (4.91) to the uniform distribution, with weights that sum
    to c K in every model. It is taken over the states and actions where walls make the fewest
    outcomes one: none in a hallway of some width.
    """
    models = problem.outcome_models
    n_distinct = 1 + (np.diff(np.sort(models.successors, axis=2)) != 0).sum(axis=2)
    n_distinct = np.where(models.available, n_distinct, 0)
    most = np.zeros(models.n_models, dtype=np.int64)
    np.maximum.at(most, models.model_of, n_distinct)
    used = models.available & (n_distinct == most[models.model_of])
    counts = np.bincount(models.model_of[used], minlength=models.n_models)
    weights = pseudo_count * models.n_outcomes / np.maximum(counts, 1)[models.model_of]
    return KldPrior(
        weight=1.0,
        reference=np.full((models.n_models, models.n_outcomes), 1.0 / models.n_outcomes),
        block=block,
        state_action_weights=np.where(used, weights, 0.0),
    )


def _uniform_on_both(data: FitData) -> Prior:
    """The same on the truth and on the belief, where these are two blocks."""
    truth, belief = (
        uniform_prior(data.problem, block, data.settings.pseudo_count)
        for block in (Block.TRUTH, Block.BELIEF)
    )
    return truth + belief


def _with_best_weight(
    data: FitData, fit: Callable[[FitData, Decisions, float, OnStep], FitResult], prior: str
) -> MethodResult:
    """Choose the weight on validation, then fit all episodes with it."""
    candidates = sorted(data.settings.prior_weights)
    validation: tuple[tuple[float, float], ...] = ()
    if len(candidates) == 1:
        weight, how = candidates[0], "given"
    elif not len(data.validation):
        weight, how = data.settings.default_prior_weight, "default for one episode"
    else:
        total = len(candidates) + 1

        def fit_candidate(weight: float) -> FitResult:
            number = 1 + candidates.index(weight)
            return fit(data, data.training, weight, data.reporter(number, total, weight))

        selection = select_weight(
            fit_candidate,
            lambda found: validation_log_likelihood(data.problem, data.validation, found),
            candidates,
        )
        weight, how = selection.weight, "chosen on validation episodes"
        validation = tuple(zip(candidates, selection.scores.tolist(), strict=True))
    number = len(validation) + 1
    found = fit(data, data.decisions, weight, data.reporter(number, number, weight))
    words = f"{prior}, weight {weight:g} ({how}); {_serd_prior(data)}"
    return MethodResult(found, words, weight, validation)


def _fit_serd(
    data: FitData, decisions: Decisions, belief: Belief, prior: Prior, on_step: OnStep | None
) -> FitResult:
    return fit_mdce_serd(
        data.problem,
        decisions,
        initial_weights=data.start(decisions, on_step),
        dynamics=data.start_dynamics(decisions),
        belief=belief,
        prior=prior + data.reward_prior,
        ascent=ASCENT,
        on_step=on_step,
    )


def _described(fit: FitResult, problem: NavigationProblem) -> str:
    """The prior that a fit by evidence chose."""
    assumed = fit.assumptions
    if assumed is None:
        return "by evidence"
    strengths = strengths_of(assumed.prior, problem)
    ratio = strengths["intended_ratio"]
    intended = "" if ratio == 1.0 else f", of the intended one {ratio:.3g} times that"
    return (
        f"by evidence: normal on reward weights, standard deviation {strengths['deviation']:.3g}"
        " nats over the range of a feature; Dirichlet on outcomes, pseudo-count"
        f" {strengths['pseudo_count']:.3g}{intended}"
    )


def _normal(data: FitData) -> str:
    return f"normal on reward weights, standard deviation {data.settings.reward_deviation:g}"


def _serd_prior(data: FitData) -> str:
    return f"uniform on outcomes, pseudo-count {data.settings.pseudo_count:g}; {_normal(data)}"
