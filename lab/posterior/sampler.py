"""Draws from the posterior itself, by the no-U-turn sampler on its exact gradients.

Chains run in the coordinates z of Laplace's approximation, u = u* + root z, in which the posterior
is close to a standard normal distribution, by dynamic integration times (Hoffman and Gelman, JMLR
15, 2014; Betancourt, arXiv:1701.02434) of the library mici. A posterior of several maxima is
sampled around each, and the draws are mixed by the modes' weights. What did not mix is no result:
SerdError, where rank-normalised R-hat or effective sample sizes (Vehtari et al., Bayesian Analysis
16, 2021) miss their limits or a trajectory diverged. Needs `pip install mici arviz`.
"""

import importlib
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from lab.posterior.modes import PosteriorModes
from serd_core.arrays import FloatArray
from serd_core.bayes.laplace import Laplace, PosteriorDraws, draws_at
from serd_core.bayes.surrogate import SOLVER
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.posterior.coordinates import LogPosterior

#: Vehtari et al. (2021): chains mixed, and means and quantiles are known well enough.
LARGEST_R_HAT, LEAST_SAMPLES = 1.01, 400
#: Share of the draws after warm-up whose trajectory may diverge.
DIVERGED_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class SampledPosterior:
    """Draws that mixed, with what shows it.

    draws: of all chains of all modes, in shares of the weights; r_hat: the largest;
    n_effective: the smallest effective sample size, of bulk and tails; n_diverged: trajectories.
    """

    draws: PosteriorDraws
    r_hat: float
    n_effective: float
    n_diverged: int


def sample_posterior(
    problem: Problem,
    modes: PosteriorModes,
    rng: np.random.Generator,
    *,
    n_chains: int = 4,
    n_draws: int = 500,
    n_warm_up: int = 200,
    least_weight: float = 0.01,
) -> SampledPosterior:
    """Chains around every mode of at least that weight."""
    arviz = _library("arviz")
    kept = modes.weights >= min(least_weight, float(modes.weights.max()))
    weights = modes.weights[kept] / modes.weights[kept].sum()
    found = [
        _chains(modes.objective, one, rng, n_chains, n_draws, n_warm_up)
        for one, keep in zip(modes.approximations, kept, strict=True)
        if keep
    ]
    checks = [_require_mixed(arviz, chains, diverged) for chains, diverged in found]
    n_total = n_chains * n_draws
    points = [
        rng.permutation(chains.reshape(n_total, -1))[: max(1, round(n_total * weight))]
        for (chains, _), weight in zip(found, weights, strict=True)
    ]
    space = modes.objective.coordinates
    return SampledPosterior(
        draws=draws_at(problem, space, np.concatenate(points)),
        r_hat=max(r_hat for r_hat, _ in checks),
        n_effective=min(size for _, size in checks),
        n_diverged=sum(int(diverged.sum()) for _, diverged in found),
    )


def _chains(
    objective: LogPosterior,
    around: Laplace,
    rng: np.random.Generator,
    n_chains: int,
    n_draws: int,
    n_warm_up: int,
) -> tuple[FloatArray, FloatArray]:
    """(chains, draws, d) coordinates and (chains, draws) whether the trajectory diverged."""
    mici = _library("mici")
    objective = replace(objective, posterior=replace(objective.posterior, solver=SOLVER))
    top = objective.evaluate(around.mode)[0]

    def loss(z: FloatArray) -> float:
        return top - objective.evaluate(around.mode + around.root @ z)[0]

    def loss_gradient(z: FloatArray) -> tuple[FloatArray, float]:
        value, gradient = objective.evaluate(around.mode + around.root @ z)
        return -(around.root.T @ gradient), top - value

    system = mici.systems.EuclideanMetricSystem(loss, grad_neg_log_dens=loss_gradient)
    integrator = mici.integrators.LeapfrogIntegrator(system)
    sampler = mici.samplers.DynamicMultinomialHMC(system, integrator, rng)
    starts = rng.standard_normal((n_chains, len(around.mode)))
    output = sampler.sample_chains(
        n_warm_up,
        n_draws,
        list(starts),
        adapters=[mici.adapters.DualAveragingStepSizeAdapter()],
        trace_funcs=[_position],
        display_progress=False,
    )
    z = np.stack(output.traces["z"])
    return around.mode + z @ around.root.T, np.stack(output.statistics["diverging"])


def _position(state: Any) -> dict[str, FloatArray]:
    return {"z": state.pos}


def _require_mixed(
    arviz: ModuleType, chains: FloatArray, diverged: FloatArray
) -> tuple[float, float]:
    """Largest R-hat and smallest effective sample size; SerdError where they miss their limits."""
    sizes = [_of_each(arviz.ess, chains, method=method) for method in ("bulk", "tail")]
    r_hat = float(_of_each(arviz.rhat, chains).max())
    size = float(min(each.min() for each in sizes))
    share = float(np.mean(diverged))
    if not (r_hat <= LARGEST_R_HAT and size >= LEAST_SAMPLES and share <= DIVERGED_SHARE):
        raise SerdError(
            f"chains must have mixed, with R-hat at most {LARGEST_R_HAT}, {LEAST_SAMPLES} effective"
            f" samples and at most {DIVERGED_SHARE:.0%} of divergent trajectories, got {r_hat:.3f},"
            f" {size:.0f} and {share:.1%}; take more draws, or a stronger prior"
        )
    return r_hat, size


def _of_each(measure: Callable[..., Any], chains: FloatArray, **options: str) -> FloatArray:
    """(d,) a diagnostic of every coordinate."""
    columns = np.moveaxis(chains, 2, 0)
    return np.array([float(measure(column, **options)) for column in columns])


def _library(name: str) -> ModuleType:
    try:
        with warnings.catch_warnings():
            # ArviZ announces its next version with each import.
            warnings.simplefilter("ignore")
            return importlib.import_module(name)
    except ImportError as error:
        raise SerdError(
            f"sampling needs the library {name}, which is not installed; pip install"
            " mici arviz, or use laplace_draws"
        ) from error
