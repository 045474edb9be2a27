"""Outcome models with covariates: log odds of outcomes that are linear in features of (s, a).

    P(k | x) = exp(beta x . w_k) / sum_j exp(beta x . w_j)

x is the row of the pair (s, a) in a table of covariates (density of people, their relative speed,
width, ...), w_k the (F,) coefficients of outcome k. Pairs with the same covariates share a row, and
the M rows are the local models of `OutcomeModels`. Table 5.1 is the case in which each row
indicates one model (x = unit vector). The parameter vector is w, row-major (F * K,): the
coefficients of one feature lie together, as the energies of one model do in Table 5.1, and priors
treat them alike.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from serd_core.arrays import FloatArray, float_array, weighted_counts
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import Observations, observe_in
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem

#: Slope per observation that is rounding.
ROUNDED_SLOPE = 1e-8


@dataclass(frozen=True, eq=False, kw_only=True)
class CovariateModels(OutcomeModels):
    """Outcome models of M rows of covariates.

    covariates: (M, F), of each value of `model_of`; covariate_names: (F,), empty for numbers.
    """

    covariates: FloatArray
    covariate_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        table = float_array("covariates", self.covariates, (self.n_models, None))
        rank = int(np.linalg.matrix_rank(table))
        if rank < table.shape[1]:
            raise SerdError(
                f"covariates must have linearly independent columns, got rank {rank} of"
                f" {table.shape[1]}; leave out what follows from the others"
            )
        names = self.covariate_names or tuple(f"covariate {f}" for f in range(table.shape[1]))
        if len(names) != table.shape[1]:
            raise SerdError(
                f"covariate_names must have one name per column ({table.shape[1]}), got {names}"
            )
        object.__setattr__(self, "covariates", table)
        object.__setattr__(self, "covariate_names", names)

    @property
    def n_parameters(self) -> int:
        """F * K coefficients."""
        return int(self.covariates.shape[1]) * self.n_outcomes

    @cached_property
    def coefficient_models(self) -> OutcomeModels:
        """One model per feature, whose energies are the coefficients of that feature."""
        one = np.zeros((1, 1), dtype=np.int64)
        return OutcomeModels(
            successors=np.zeros((1, 1, self.n_outcomes), dtype=np.int64),
            model_of=one,
            available=one == 0,
            n_models=self.covariates.shape[1],
            beta=self.beta,
        )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """(F*K,) one name per coefficient."""
        return tuple(
            f"{name}, outcome {k}" for name in self.covariate_names for k in range(self.n_outcomes)
        )

    @property
    def gauge(self) -> FloatArray:
        """(F, F*K) adding a constant to all coefficients of a feature changes nothing."""
        return self.coefficient_models.gauge

    def energies(self, parameters: FloatArray) -> FloatArray:
        """(M, K) energies x . w."""
        return np.asarray(self.covariates @ np.reshape(parameters, (-1, self.n_outcomes)))

    def local_jacobian(self, parameters: FloatArray) -> FloatArray:
        """(M*K, F*K) derivative of the probabilities by the coefficients."""
        slope = self._slope(self.local_probabilities(parameters))
        table = np.einsum("mf,mkj->mkfj", self.covariates, slope)
        return np.asarray(table.reshape(-1, self.n_parameters))

    def local_curvature(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        """(F*K, F*K) second derivatives of local_gradient . probabilities."""
        x, bend = self.covariates, self._bend(self.local_probabilities(parameters), local_gradient)
        table = np.einsum("mf,mg,mkj->fkgj", x, x, bend, optimize=True)
        return np.asarray(table.reshape(self.n_parameters, self.n_parameters))

    def pull_back(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        """(F*K,) gradient by the coefficients for an (M, K) gradient by the probabilities."""
        by_energy = super().pull_back(parameters, local_gradient)
        return np.asarray(self.covariates.T @ by_energy.reshape(self.n_models, -1)).ravel()

    def parameters_of(self, initial: FloatArray) -> FloatArray:
        """(F*K,) coefficients whose energies are nearest to those of (M, K) probabilities.

        Exact where the log odds are linear in the covariates; otherwise a start for a search.
        """
        return self._nearest(super().parameters_of(initial))

    def fixed_parameters_of(self, known: FloatArray) -> FloatArray:
        """(F*K,) coefficients of (M, K) probabilities; SerdError where there are none."""
        found = self._nearest(super().fixed_parameters_of(known))
        off = np.abs(self.local_probabilities(found) - known).max()
        if off > 1e-6:
            raise SerdError(
                f"log odds of known probabilities must be linear in the covariates, they are off by"
                f" {off:.2g}; pass probabilities of `local_probabilities`"
            )
        return found

    def _nearest(self, energies: FloatArray) -> FloatArray:
        table = energies.reshape(self.n_models, self.n_outcomes)
        return np.asarray(np.linalg.lstsq(self.covariates, table, rcond=None)[0]).ravel()


def most_likely_coefficients(
    model: CovariateModels, seen: Observations, pseudo_count: float = 1.0, *, max_steps: int = 2000
) -> FloatArray:
    """(F*K,) M-estimate from observed transitions: of the Dirichlet prior over each feature.

    SerdError where it did not converge.
    """
    prior = model.coefficient_models

    def loss(parameters: FloatArray) -> tuple[float, FloatArray]:
        table = model.local_probabilities(parameters)
        by_group = seen.probabilities(table)
        ratio = (seen.group_count / by_group)[seen.entry_group]
        by_table = weighted_counts(seen.local_index, ratio, table.size).reshape(table.shape)
        value = float(seen.group_count @ np.log(by_group))
        slope = model.pull_back(parameters, by_table)
        shares = prior.local_probabilities(parameters)
        value += pseudo_count * float(np.sum(np.log(shares)))
        slope = slope + (model.beta * pseudo_count * (1.0 - model.n_outcomes * shares)).ravel()
        return -value, -slope

    found = minimize(
        loss,
        np.zeros(model.n_parameters),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": max_steps, "maxfun": 5000, "ftol": 1e-14, "gtol": 1e-6},
    )
    # A line search that ends by rounding is no failure where the slope is that of rounding.
    slope = float(np.abs(found.jac).max())
    if not (found.success or slope <= ROUNDED_SLOPE * (1.0 + float(seen.group_count.sum()))):
        raise SerdError(
            f"the M-estimate of the dynamics must converge, but after {found.nit} steps its slope"
            f" is {slope:.2g}; pass dynamics, for example"
            f" those of pseudo_count={10 * max(pseudo_count, 1.0)}"
        )
    return np.asarray(found.x)


def estimated_dynamics(problem: Problem, decisions: Decisions) -> FloatArray:
    """(M, K) M-estimate of the outcome probabilities, of models with and without covariates."""
    model = problem.mdp.transitions
    if not isinstance(model, CovariateModels):
        return estimate_dynamics(problem, decisions)
    coefficients = most_likely_coefficients(model, observe_in(problem, decisions))
    return model.local_probabilities(coefficients)
