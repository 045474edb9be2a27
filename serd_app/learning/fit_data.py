"""Demonstrations as methods learn from them, what they estimate once, and their progress."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from serd_app.learning.settings import RecipeSettings
from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Step
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.navigation import FEATURE_NAMES, NavigationProblem
from serd_core.learners.mdce_irl import weights_under_initial_dynamics
from serd_core.learners.start import dynamics_of_hidden_actions
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import GaussianPrior, Prior
from serd_core.selection.evaluation import split_episodes


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


@dataclass(frozen=True, eq=False, kw_only=True)
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
    # A fit for every candidate weight starts from the same estimate and weights.
    _estimates: dict[Decisions, FloatArray] = field(default_factory=dict, init=False, repr=False)
    _starts: dict[Decisions, FloatArray] = field(default_factory=dict, init=False, repr=False)

    @property
    def reward_prior(self) -> Prior:
        """Keeps reward weights finite where few demonstrations show one action only."""
        return GaussianPrior(self.settings.reward_deviation, Block.REWARD)

    def estimate(self, decisions: Decisions) -> FloatArray:
        """(M, K) M-estimate of the dynamics."""
        if decisions not in self._estimates:
            pseudo_count = self.settings.pseudo_count
            self._estimates[decisions] = estimate_dynamics(self.problem, decisions, pseudo_count)
        return self._estimates[decisions]

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
    training, validation = decisions, decisions.select_episodes([])
    if len(decisions.episodes) > 1:
        training, validation = split_episodes(decisions, settings.validation_share, rng)
    return FitData(
        problem=problem,
        settings=settings,
        decisions=decisions,
        training=training,
        validation=validation,
        rng=rng,
        initial_weights=initial_weights,
        on_progress=on_progress,
    )
