"""The record every learner returns, and that of its standard errors."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import AscentResult
from serd_core.checks import require_kind, require_share
from serd_core.display import Record, html_table
from serd_core.errors import SerdError
from serd_core.policies.solved_policy import PolicyModel
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue
from serd_core.priors.prior import Prior


@dataclass(frozen=True)
class Assumptions:
    """What a fit assumed; prior: without that of the belief.

    by_likelihood: whether it maximised the likelihood, with the prior; other criteria have maxima
    elsewhere. None where a file of version 0.2.0 does not state it.
    open_strengths: of a prior by evidence, those that draws of the posterior sample.
    """

    policy_model: PolicyModel
    belief: Belief
    prior: Prior
    by_likelihood: bool | None = None
    open_strengths: tuple[str, ...] = ()

    @property
    def whole_prior(self) -> Prior:
        """The prior together with that of the belief."""
        return self.prior + self.belief.prior


@dataclass(frozen=True, eq=False, repr=False)
class StandardErrors(Record):
    """Standard errors; infinite where the data do not identify a number.

    free: (n,) of the free numbers, named by `names`; covariance: (n, n) over what is identified.
    reward: (F,); outcome_probabilities: (M, K) of the true dynamics;
    believed_outcome_probabilities: (M, K) of the expert's belief.
    """

    names: tuple[str, ...]
    free: FloatArray
    covariance: FloatArray
    reward: FloatArray
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray

    def reward_interval(
        self, weights: FloatArray, coverage: float = 0.95
    ) -> tuple[FloatArray, FloatArray]:
        """Ends of the normal (Wald) intervals of (F,) reward weights, for many decisions."""
        require_share("coverage", coverage)
        width = float(ndtri(0.5 + coverage / 2.0)) * self.reward
        return weights - width, weights + width


@dataclass(frozen=True, eq=False, repr=False)
class FitResult:
    """Learned rewards and dynamics, and how the fit went.

        fit = sc.fit_mdce_serd(problem, decisions)
        print(fit.reward_weights, fit.outcome_probabilities, fit.converged, fit.message)

    parameters: all blocks at the end; outcomes that fixed dynamics rule out have energies so low
    that their probability is exactly 0.
    outcome_probabilities: (M, K) of the true dynamics; believed_outcome_probabilities: of the
    expert's belief; initial_outcome_probabilities: the start. (Of known transitions: their entries;
    `problem.mdp.transitions.laws(fit.parameters.truth)` has laws of dwell times.)
    temperature: theta_P; 1 where the policy model has none, as soft policies do.
    objective: what the learner maximised (SERD: the log posterior J); objective_trace: (n_steps,).
    policy_log_likelihood, dynamics_log_likelihood: of decisions with their action, the second with
    their dwell times where moves take time; hidden_log_likelihood: of those without.
    gradient_norm: largest entry of the gradient over the numbers that were free, for SERD per
    decision, for learners of rewards alone over weights times the range of their feature; at a
    kink that of the smallest mean of the gradients around (`KinkedAscent`).
    newton_decrement: length of the Newton step at the end, in standard errors; NaN at kinks.
    converged: at a maximum, and the only one around; else the message names the open direction.
    undetermined: directions along which nothing but a prior of rewards bounds the objective.
    residual, error_bound: of the values V at the end, max |T V - V| for the Bellman operator T, and
    a bound of the error of V. NaN, and None for assumptions, where a file has none.
    """

    feature_names: tuple[str, ...]
    parameters: Parameters
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray
    initial_outcome_probabilities: FloatArray
    temperature: float
    objective: float
    policy_log_likelihood: float
    dynamics_log_likelihood: float
    log_prior: float
    gradient_norm: float
    n_decisions: int
    n_steps: int
    n_evaluations: int
    converged: bool
    message: str
    objective_trace: FloatArray
    residual: float
    error_bound: float
    assumptions: Assumptions | None
    undetermined: tuple[str, ...] = ()
    hidden_log_likelihood: float = 0.0
    newton_decrement: float = np.nan

    def summary(self, errors: StandardErrors | None = None) -> str:
        """A table of the reward weights and how the fit went, for people.

        errors: of `standard_errors`, which add standard errors and 95 % intervals.
        """
        lines = [
            f"converged: {self._state} ({self.message})",
            f"decisions: {self.n_decisions}   steps: {self.n_steps}{self._distance}",
            f"log-likelihood: {self.policy_log_likelihood:.4f} of actions,"
            f" {self.dynamics_log_likelihood:.4f} of transitions,"
            f" {self.hidden_log_likelihood:.4f} of moves with hidden actions",
            "",
        ]
        weights, width = self.reward_weights, max(map(len, ("reward", *self.feature_names)))
        columns = [("weight", "11.5g", weights)]
        if errors is not None:
            low, high = errors.reward_interval(weights)
            columns += [
                ("std. error", "11.4g", errors.reward),
                ("z", "8.2f", weights / errors.reward),
            ]
            columns += [("2.5 %", "11.5g", low), ("97.5 %", "11.5g", high)]
        header, *rows = (f"{name:{width}}" for name in ("reward", *self.feature_names))
        for title, form, values in columns:
            header += f"  {title:>{form.partition('.')[0]}}"
            rows = [f"{row}  {value:{form}}" for row, value in zip(rows, values, strict=True)]
        return "\n".join([*lines, header, *rows])

    def __repr__(self) -> str:
        named = zip(self.feature_names, self.reward_weights, strict=True)
        weights = ", ".join(f"{name} {weight:.4g}" for name, weight in named)
        return f"<FitResult: {weights}; {self.n_decisions} decisions; converged: {self._state}>"

    def _repr_html_(self) -> str:
        head = f"converged: {self._state} ({self.message}); {self.n_decisions} decisions"
        weights = zip(self.feature_names, self.reward_weights.round(4), strict=True)
        tables, learned = [html_table(head, ("reward", "weight"), *weights)], self.parameters.truth
        if learned.size and (table := self.outcome_probabilities).ndim == 2:
            header = ("model", *(f"outcome {k}" for k in range(table.shape[1])))
            rows = ((m, *row) for m, row in enumerate(table.round(3)))
            tables.append(html_table("outcome probabilities", header, *rows))
        return "".join(tables)

    @property
    def _state(self) -> str:
        if self.converged:
            return "in what decisions determine" if self.undetermined else "yes"
        return "no"

    @property
    def _distance(self) -> str:
        step = self.newton_decrement
        return "" if np.isnan(step) else f"   Newton step: {step:.1g} standard errors"

    @property
    def reward_weights(self) -> FloatArray:
        """(F,) theta_R in the order of `feature_names`."""
        return self.parameters.reward

    @property
    def assumed(self) -> Assumptions:
        """The assumptions; SerdError where there are none."""
        if self.assumptions is None:
            raise SerdError("the fit must record what it assumed, got none; fit again")
        return self.assumptions


def fit_result(
    posterior: Posterior,
    assumptions: Assumptions,
    parameters: Parameters,
    final: PosteriorValue,
    ascended: AscentResult,
    tables: tuple[FloatArray, FloatArray, FloatArray],
    undetermined: tuple[str, ...] = (),
) -> FitResult:
    """The record of an ascent that ended at `parameters`, where the posterior is `final`."""
    truth, belief, initial = tables
    return FitResult(
        feature_names=posterior.problem.feature_names,
        parameters=parameters,
        outcome_probabilities=truth,
        believed_outcome_probabilities=belief,
        initial_outcome_probabilities=initial,
        temperature=assumptions.policy_model.temperature(parameters.policy),
        objective=ascended.objective,
        policy_log_likelihood=final.policy_log_likelihood,
        dynamics_log_likelihood=final.dynamics_log_likelihood,
        log_prior=final.log_prior,
        gradient_norm=ascended.gradient_norm,
        n_decisions=posterior.observations.n_decisions,
        n_steps=ascended.n_steps,
        n_evaluations=ascended.n_evaluations,
        converged=ascended.converged and final.solution.converged,
        message=ascended.message,
        objective_trace=ascended.objective_trace,
        residual=final.solution.residual,
        error_bound=final.solution.error_bound,
        assumptions=assumptions,
        undetermined=undetermined,
        hidden_log_likelihood=final.hidden_log_likelihood,
        newton_decrement=ascended.newton_decrement,
    )


def require_fit(fit: object, name: str = "fit") -> None:
    """SerdError unless an argument is a `FitResult`."""
    require_kind(name, fit, (FitResult,), "fit_mdce_serd(problem, decisions)")
