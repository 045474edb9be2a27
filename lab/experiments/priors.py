"""What each prior prefers (section 4.5.4, Fig. 4.6, Table 4.3).

A Boltzmann distribution over two outcomes, P(x_i) proportional to exp(theta_i); each log prior is
maximised on the circle |theta|_2 = 1, which stands in for the likelihood.
"""

import numpy as np
import pandas as pd

from lab.estimators.priors import EntropyPrior, NormPrior
from lab.experiments.running.experiment import Findings, Session
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.divergence import KldPrior
from serd_core.priors.prior import Prior
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel

#: One state with two outcomes: stay, or leave for a second state that only stays.
MODEL = OutcomeModels(
    successors=np.array([[[0, 1]], [[1, 1]]]),
    model_of=np.zeros((2, 1), dtype=np.int64),
    available=np.ones((2, 1), dtype=np.bool_),
    n_models=1,
)
REFERENCE = np.array([[0.9, 0.1]])
PRIORS: dict[str, Prior] = {
    "L1": NormPrior(1.0, Block.TRUTH, p=1.0, smoothing=1e-9),
    "L2": NormPrior(1.0, Block.TRUTH, p=2.0, smoothing=1e-9),
    "Entropy": EntropyPrior(1.0),
    "KLD(Q||P)": KldPrior(1.0, REFERENCE),
}


class PriorsConfig(StrictModel):
    """Settings of section 4.5.4."""

    n_angles: int = setting(7_200, "points on the unit circle among which optima are sought", ge=8)


def run_priors(config: PriorsConfig, session: Session) -> Findings:
    """The maxima."""
    optima = optimal_distributions(config)
    session.progress(1, 1)
    return Findings(optima, {"optimal_distributions.csv": optima})


def optimal_distributions(config: PriorsConfig) -> pd.DataFrame:
    """Right column of Table 4.3: one row per maximum on the circle.

    Where all points of the circle are as good, one row has None for the numbers.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, config.n_angles, endpoint=False)
    rows = [row for name, prior in PRIORS.items() for row in _optima(name, prior, angles)]
    return pd.DataFrame(rows)


def log_prior(prior: Prior, one: float, two: float) -> float:
    """log P(theta) + Z at theta = (one, two)."""
    theta = np.array([one, two])
    return prior.evaluate(MODEL, Parameters(np.zeros(0), theta, theta, np.zeros(0))).value


def _optima(name: str, prior: Prior, angles: FloatArray) -> list[Row]:
    values = np.array([log_prior(prior, np.cos(angle), np.sin(angle)) for angle in angles])
    if np.ptp(values) < 1e-9:
        return [_row(name, float(values[0]), None)]
    # Neighbours that are equal within rounding belong to one maximum: the first of them counts.
    best = values >= values.max() - 1e-12
    first = best & ~np.roll(best, 1)
    return [_row(name, float(values.max()), float(angle)) for angle in angles[first]]


def _row(name: str, value: float, angle: float | None) -> Row:
    row: Row = {"prior": name, "log_prior": value}
    columns = ("theta_1", "theta_2", "p_1", "p_2")
    if angle is None:
        return row | dict.fromkeys(columns)
    theta = np.array([np.cos(angle), np.sin(angle)])
    numbers = [*theta, *MODEL.local_probabilities(theta)[0]]
    return row | dict(zip(columns, map(float, numbers), strict=True))
