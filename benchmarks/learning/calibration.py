"""Simulation-based calibration of both posteriors on a small problem, over 500 data sets each.

    python -m benchmarks calibration

Five states, two actions with an outcome model of three outcomes each, one feature; the prior's
strengths are 2 nats and 2 pseudo-counts. A p-value below 0.05 / 7 rejects (seven numbers).
"""

import numpy as np

from benchmarks.report import save
from serd_core.bayes.calibration import (
    N_RANKED,
    Draw,
    calibration_ranks,
    draw_by_laplace,
    uniformity,
)
from serd_core.bayes.draws import PosteriorDraws
from serd_core.bayes.modes import posterior_modes
from serd_core.bayes.sampler import sample_posterior
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem

N_DATA_SETS = 500
PRIOR = PriorByEvidence(deviation=2.0, pseudo_count=2.0)


def run() -> None:
    """Rank the truth by both posteriors."""
    rows = []
    for name, draw in DRAWS.items():
        ranks = calibration_ranks(
            _problem(),
            PRIOR,
            np.random.default_rng(1),
            n_data_sets=N_DATA_SETS,
            n_episodes=20,
            n_steps=10,
            draw=draw,
        )
        p_values = uniformity(ranks)
        rows.append(
            {"posterior": name, "data sets": N_DATA_SETS, "least p": float(p_values.min())}
            | {f"p {number}": float(p) for number, p in enumerate(p_values)}
        )
    save("calibration", "Simulation-based calibration", rows)


def _sampled(
    problem: Problem, decisions: Decisions, fit: FitResult, rng: np.random.Generator
) -> PosteriorDraws:
    """Draws of the sampler, thinned at random to the number that is ranked."""
    modes = posterior_modes(problem, decisions, fit, rng, n_starts=3)
    draws = sample_posterior(problem, modes, rng).draws
    kept = rng.choice(len(draws), N_RANKED, replace=False)
    return PosteriorDraws(
        draws.coordinates[kept],
        draws.reward[kept],
        draws.outcome_probabilities[kept],
        draws.believed_outcome_probabilities[kept],
    )


def _problem() -> TabularProblem:
    rng = np.random.default_rng(0)
    models = OutcomeModels(
        rng.integers(5, size=(5, 2, 3)), np.tile([0, 1], (5, 1)), np.ones((5, 2), bool), 2
    )
    features = np.repeat(rng.normal(size=(5, 1, 1)), 2, axis=1)
    return TabularProblem(Mdp(models, 0.8), features, ("one",))


DRAWS: dict[str, Draw] = {"Laplace": draw_by_laplace, "no-U-turn sampler": _sampled}
