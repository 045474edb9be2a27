"""How long moves take: gamma distributions with covariates, and a pace that each person has.

The dwell time of move j of person i, of kind k, is

    tau_ij = exp(x_ij . beta + b_i) g_ij,   b_i ~ Normal(0, sigma^2),   g_ij ~ Gamma(1/phi_k, phi_k)

so exp(x . beta + b) is its mean, phi_k the squared coefficient of variation of kind k, and the pace
b_i multiplies all times of a person. Fitted by penalised quasi-likelihood (Breslow and Clayton,
Journal of the American Statistical Association 88, 1993): with the working response
z = log mu + (tau - mu) / mu, a linear mixed model of weights 1 / phi_k, whose variances take steps
of expectation maximisation.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammainc, gammaln, logsumexp

from serd_core.arrays import (
    FloatArray,
    IntArray,
    first_index,
    float_array,
    int_array,
    require_each,
    weighted_counts,
)
from serd_core.arrival.law import ArrivalLaw
from serd_core.errors import SerdError

MOST_STEPS, TOLERANCE = 5000, 1e-6
#: Added for one more person and one more move of each kind, so that no variance is 0.
_LEAST_VARIANCE = 1e-4
_RIDGE = 1e-6
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(21)
_WEIGHTS /= _WEIGHTS.sum()


@dataclass(frozen=True, eq=False)
class Pace:
    """Normal distribution of a person's b: how much slower than others, as log of times."""

    mean: float
    variance: float

    def factors(self) -> tuple[FloatArray, FloatArray]:
        """(Q,) factors exp(b) and their weights, by Gauss-Hermite quadrature."""
        return np.exp(self.mean + np.sqrt(self.variance) * _NODES), _WEIGHTS


@dataclass(frozen=True, eq=False)
class DwellModel:
    """coefficients: (F,) beta; dispersion: (C,) phi of each kind; pace_variance: sigma^2."""

    coefficients: FloatArray
    dispersion: FloatArray
    pace_variance: float
    converged: bool = True

    def mean_s(self, design: FloatArray) -> FloatArray:
        """(N,) mean dwell times at pace 0 for an (N, F) design."""
        return np.asarray(np.exp(design @ self.coefficients))

    def pace(self, dwell_s: FloatArray, design: FloatArray, kind: IntArray) -> Pace:
        """Posterior of a person's pace given moves of hers, by Laplace's approximation."""
        scaled, weight = dwell_s / self.mean_s(design), 1.0 / self.dispersion[kind]
        b, precision = 0.0, 1.0 / self.pace_variance
        for _ in range(MOST_STEPS):
            waiting = weight * scaled * np.exp(-b)
            step = (waiting.sum() - weight.sum() - b * precision) / (waiting.sum() + precision)
            b += float(np.clip(step, -1.0, 1.0))
            if abs(step) < TOLERANCE:
                break
        precision += float(np.sum(weight * scaled * np.exp(-b)))
        return Pace(b, 1.0 / precision)

    def log_density(self, dwell_s: float, mean_s: float, kind: int, pace: Pace) -> float:
        """Log density of one dwell time of that mean at pace 0, the pace being uncertain."""
        factors, weights = pace.factors()
        shape = 1.0 / self.dispersion[kind]
        scale = mean_s * factors / shape
        logs = (shape - 1) * np.log(dwell_s) - dwell_s / scale - shape * np.log(scale)
        return float(logsumexp(logs - gammaln(shape), b=weights))

    def mass(self, mean_s: FloatArray, kind: IntArray, step_s: float, n_steps: int) -> FloatArray:
        """(C, n_steps + 1) of moves of given means (C,) and kinds: rounded to whole steps."""
        edges = (np.arange(n_steps + 2) - 0.5).clip(0) * step_s
        shape = 1.0 / self.dispersion[kind]
        cdf = gammainc(shape[:, None], edges * (shape / mean_s)[:, None])
        return np.diff(cdf, axis=1)


def fit_dwell_times(
    dwell_s: FloatArray,
    design: FloatArray,
    kind: IntArray,
    person: IntArray,
    n_kinds: int | None = None,
) -> DwellModel:
    """Fit to N moves.

    dwell_s: (N,) above 0; design: (N, F); kind: (N,) from 0; person: (N,) any numbers. Kinds of
    which there are no moves have the dispersion of all; n_kinds: None for the largest kind + 1.
    """
    times = float_array("dwell_s", dwell_s, (None,))
    rows = float_array("design", design, (len(times), None))
    kinds = int_array("kind", kind, (len(times),))
    bad = first_index(~(times > 0))
    if bad is not None or not len(times):
        received = "none" if bad is None else f"{times[bad[0]]} in row {bad[0]}"
        raise SerdError(
            f"dwell_s must hold times above 0, got {received}; merge crossings at the same time"
        )
    people, who = np.unique(int_array("person", person, (len(times),)), return_inverse=True)
    n_people = len(people)
    n_kinds = int(kinds.max()) + 1 if n_kinds is None else n_kinds
    rule = f"be from 0 to n_kinds - 1 = {n_kinds - 1}"
    require_each("kind", kinds, (kinds >= 0) & (kinds < n_kinds), rule, "number the kinds from 0")
    beta = np.asarray(np.linalg.lstsq(rows, np.log(times), rcond=None)[0], dtype=np.float64)
    pace, pace_variance = np.zeros(n_people), 0.05
    dispersion = np.full(n_kinds, 0.1)
    for _ in range(MOST_STEPS):
        before = np.concatenate([beta, np.log(dispersion), [np.log(pace_variance)]])
        eta = rows @ beta + pace[who]
        off = np.clip(times * np.exp(-eta) - 1.0, -1.0, 5.0)
        response, weight = eta + off, 1.0 / dispersion[kinds]
        total = weighted_counts(who, weight, n_people)
        share = 1.0 / (1.0 / pace_variance + total)
        beta = _weighted_coefficients(rows, response, weight, who, share)
        residual = response - rows @ beta
        pace = share * weighted_counts(who, weight * residual, n_people)
        left = (residual - pace[who]) ** 2 + share[who]
        pace_variance = float((np.sum(pace**2 + share) + _LEAST_VARIANCE) / (n_people + 1.0))
        count = weighted_counts(kinds, np.ones(len(times)), n_kinds)
        dispersion = np.asarray(
            (weighted_counts(kinds, left, n_kinds) + left.mean() + _LEAST_VARIANCE) / (count + 1.0)
        )
        after = np.concatenate([beta, np.log(dispersion), [np.log(pace_variance)]])
        if np.abs(after - before).max() < TOLERANCE:
            return DwellModel(beta, dispersion, pace_variance)
    return DwellModel(beta, dispersion, pace_variance, converged=False)


def _weighted_coefficients(
    rows: FloatArray, response: FloatArray, weight: FloatArray, who: IntArray, share: FloatArray
) -> FloatArray:
    """Generalised least squares with one intercept per person integrated out."""
    weighted = rows * weight[:, None]
    sums = np.zeros((len(share), rows.shape[1]))
    np.add.at(sums, who, weighted)
    by_response = weighted_counts(who, weight * response, len(share))
    information = rows.T @ weighted - sums.T @ (share[:, None] * sums)
    information[np.diag_indices_from(information)] += _RIDGE * len(rows)
    return np.asarray(
        np.linalg.solve(information, weighted.T @ response - sums.T @ (share * by_response))
    )


def paced_law(law: ArrivalLaw, pace: Pace) -> ArrivalLaw:
    """The law at pace 0 as that of a person whose pace multiplies all times: E_b[F(t exp(-b))]."""
    factors, weights = pace.factors()
    times_s = np.concatenate([[0.0], law.times_s])
    cdf = np.concatenate([[0.0], law.cdf])
    asked = law.times_s[:, None] / factors
    return replace(law, cdf=np.interp(asked, times_s, cdf) @ weights, cdf_draws=None)
