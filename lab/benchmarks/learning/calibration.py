"""Simulation-based calibration of both posteriors on a small problem, over 500 data sets each.

    python -m lab calibration

It goes on where it was stopped.

Five states, two actions with an outcome model of three outcomes each, one feature; the prior's
strengths are 2 nats and 2 pseudo-counts. A p-value below 0.05 / 7 rejects (seven numbers).
"""

import numpy as np

from lab.benchmarks.report import measured_rows, save
from lab.posterior.calibration import N_RANKED, Draw, calibration_ranks, draw_by_laplace, uniformity
from lab.posterior.modes import posterior_modes
from lab.posterior.sampler import sample_posterior
from serd_core.bayes.laplace import PosteriorDraws
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem

N_DATA_SETS = 500
PRIOR = PriorByEvidence(deviation=2.0, pseudo_count=2.0)


def run() -> None:
    """Rank the truth by both posteriors, in the data sets that are missing."""
    cases = [
        {"posterior": posterior, "data_set": number}
        for number in range(N_DATA_SETS)
        for posterior in DRAWS
    ]
    measured = measured_rows("calibration", cases, measure)
    rows = []
    for posterior in DRAWS:
        found = [row["ranks"] for row in measured if row["posterior"] == posterior]
        p_values = uniformity(np.array([ranks for ranks in found if ranks]))
        rows.append(
            {"posterior": posterior, "data sets": len(found), "not sampled": found.count([])}
            | {"least p": float(p_values.min())}
            | {f"p {number}": float(p) for number, p in enumerate(p_values)}
        )
    save("calibration", "Simulation-based calibration", rows)


def measure(posterior: str, data_set: int) -> dict[str, list[int]]:
    """Ranks of the truth in one data set; none where the chains did not mix."""
    try:
        ranks = calibration_ranks(
            small_problem(),
            PRIOR,
            np.random.default_rng([1, data_set]),
            n_data_sets=1,
            n_episodes=20,
            n_steps=10,
            draw=DRAWS[posterior],
        )
    except SerdError:
        return {"ranks": []}
    return {"ranks": ranks[0].tolist()}


def _sampled(
    problem: Problem, decisions: Decisions, fit: FitResult, rng: np.random.Generator
) -> PosteriorDraws:
    """Draws of the sampler, thinned at random to the number that is ranked.

    Chains that did not mix are run again, twice as long.
    """
    modes = posterior_modes(problem, decisions, fit, rng, n_starts=3)
    try:
        found = sample_posterior(problem, modes, rng, n_draws=400, n_warm_up=50)
    except SerdError:
        found = sample_posterior(problem, modes, rng, n_draws=800)
    return found.draws.select(rng.choice(len(found.draws), N_RANKED, replace=False))


def small_problem() -> TabularProblem:
    """Five states, two actions with an outcome model of three outcomes each, one feature."""
    rng = np.random.default_rng(0)
    models = OutcomeModels(
        rng.integers(5, size=(5, 2, 3)), np.tile([0, 1], (5, 1)), np.ones((5, 2), bool), 2
    )
    features = np.repeat(rng.normal(size=(5, 1, 1)), 2, axis=1)
    return TabularProblem(Mdp(models, 0.8), features, ("one",))


DRAWS: dict[str, Draw] = {"Laplace": draw_by_laplace, "no-U-turn sampler": _sampled}
