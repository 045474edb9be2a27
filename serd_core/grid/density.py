"""Outcome models of section 5.1 whose log odds are linear in the density of people.

    P(k | m, rho) = exp(beta (a_mk + b_mk rho)) / sum_j exp(beta (a_mj + b_mj rho))

m is one of `MODEL_NAMES`, rho the density (people per m²) in the cell that the action aims at, in
steps of `STEP_PM2`. Without b it is Table 5.1. Rows of tables are (density, model) for all of
`DENSITIES_PM2`, so that one table holds for every crowd. Its first 2 M rows, at 0 and at 1 person
per m², determine all others.

Each person counts as a normal distribution of standard deviation h on the floor:

    rho(c) = sum_j exp(-|c - x_j|^2 / 2 h^2) / (2 pi h^2)
"""

from dataclasses import replace

import numpy as np
from scipy.special import gammainc

from serd_core.arrays import FloatArray, IntArray, float_array
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.covariate_models import CovariateModels
from serd_core.grid.grid import Action
from serd_core.grid.navigation import INTENDED_OUTCOMES, MODEL_NAMES, NavigationProblem
from serd_core.mdp.mdp import Mdp

KERNEL_M = 0.6
STEP_PM2, MOST_PM2 = 0.25, 3.0
_ASCENDING = np.arange(0.0, MOST_PM2 + STEP_PM2 / 2, STEP_PM2)
#: Densities of the rows of a table: those that determine it, then the others.
DENSITIES_PM2: FloatArray = np.concatenate(
    [[0.0, 1.0], _ASCENDING[~np.isin(_ASCENDING, (0.0, 1.0))]]
)
#: Of the rows that determine a table.
DENSITY_MODEL_NAMES = MODEL_NAMES + tuple(f"{name}_at_1_per_m2" for name in MODEL_NAMES)
_PLACE_OF_STEP: IntArray = np.argsort(DENSITIES_PM2).astype(np.int64)
#: Smallest probability whose logarithm is extended to other densities.
_LEAST = 1e-300


def crowd_shares(
    places_m: FloatArray, people_m: FloatArray, kernel_m: float = KERNEL_M
) -> FloatArray:
    """(C, N) density that each of the people (N, 2) adds at each place (C, 2)."""
    away = places_m[:, None] - people_m[None, :]
    shares = np.exp(-np.sum(away**2, axis=2) / (2 * kernel_m**2)) / (2 * np.pi * kernel_m**2)
    return np.asarray(shares)


def with_density(problem: NavigationProblem, density_pm2: FloatArray) -> NavigationProblem:
    """The problem with outcome models that depend on the density (S,) of people in its cells."""
    density = float_array("density_pm2", density_pm2, (problem.grid.n_states,))
    return _with_rows(problem, problem.outcome_models.model_of, density[problem.grid.neighbours])


def at_decisions(
    problem: NavigationProblem, decisions: Decisions, density_pm2: FloatArray
) -> tuple[NavigationProblem, Decisions]:
    """A problem of `with_density` with a state of its own for every decision.

    Such a state is its cell in the crowd of that time, and no move leads to it: the expert sees the
    present crowd and expects that of the problem later. density_pm2: (N, 5) people per m² in the
    cell that each action aims at.
    """
    density = float_array("density_pm2", density_pm2, (len(decisions), len(Action)))
    states = np.concatenate([np.arange(problem.mdp.n_states), decisions.state])
    cells = problem.outcome_models
    usual, model_of = np.divmod(cells.model_of, len(MODEL_NAMES))
    models = replace(
        cells,
        successors=cells.successors[states],
        available=cells.available[states],
        model_of=cells.model_of[states],
    )
    extended = replace(problem, features=problem.features[states], outcome_models=models)
    densities = np.concatenate([DENSITIES_PM2[usual], density])
    found = _with_rows(extended, model_of[states], densities)
    own = problem.mdp.n_states + np.arange(len(decisions))
    return found, replace(decisions, state=own)


def full_table(rows: FloatArray) -> FloatArray:
    """(..., D * M, K) probabilities at all densities from those at 0 and 1 (..., 2 M, K)."""
    logs = np.log(np.maximum(rows, _LEAST))
    empty, at_one = np.split(logs, 2, axis=-2)
    table = [empty + density * (at_one - empty) for density in DENSITIES_PM2]
    odds = np.concatenate(table, axis=-2)
    weights = np.exp(odds - odds.max(axis=-1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def in_random_crowds(table: FloatArray) -> FloatArray:
    """(..., D * M, K) outcomes where only the mean density is known, from those at a density.

    In a crowd of independent people (Poisson) the density of the kernel has the variance
    rho / (4 pi h^2) (Campbell's theorem). It is taken as gamma distributed, in the same steps.
    """
    share = _shares_of_steps()
    shape = (*table.shape[:-2], len(DENSITIES_PM2), -1, table.shape[-1])
    mixed = np.einsum("ij,...jmk->...imk", share, table.reshape(shape))
    return np.asarray(mixed.reshape(table.shape))


def _shares_of_steps() -> FloatArray:
    """(D, D) probability of each density where the mean is that of the row."""
    scale = 1.0 / (4 * np.pi * KERNEL_M**2)
    ends = np.concatenate([_ASCENDING[:-1] + STEP_PM2 / 2, [np.inf]])
    shares = np.eye(len(DENSITIES_PM2))
    for row, mean in enumerate(DENSITIES_PM2):
        if mean > 0:
            shares[row, _PLACE_OF_STEP] = np.diff(gammainc(mean / scale, ends / scale), prepend=0)
    return shares


def _with_rows(
    problem: NavigationProblem, model_of: IntArray, density_pm2: FloatArray
) -> NavigationProblem:
    """The problem with the rows of models (S, A) at densities (S, A)."""
    steps = np.rint(np.clip(density_pm2, 0.0, MOST_PM2) / STEP_PM2).astype(np.int64)
    n_models, old = len(MODEL_NAMES), problem.outcome_models
    rows = len(DENSITIES_PM2) * n_models
    indicators = np.tile(np.eye(n_models), (len(DENSITIES_PM2), 1))
    density = np.repeat(DENSITIES_PM2, n_models)[:, None]
    models = CovariateModels(
        successors=old.successors,
        model_of=_PLACE_OF_STEP[steps] * n_models + model_of,
        available=old.available,
        n_models=rows,
        beta=old.beta,
        intended=np.tile(INTENDED_OUTCOMES, len(DENSITIES_PM2)),
        covariates=np.concatenate([indicators, density * indicators], axis=1),
        covariate_names=MODEL_NAMES + tuple(f"density, {name}" for name in MODEL_NAMES),
    )
    mdp = Mdp(models, problem.mdp.discount)
    return replace(problem, mdp=mdp, outcome_models=models, model_names=DENSITY_MODEL_NAMES)
