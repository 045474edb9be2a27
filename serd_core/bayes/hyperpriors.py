"""Priors whose strengths are learned: a base measure of outcomes, and a scale of each weight.

    w_f = u_f / range of f,   u_f ~ Normal(0, sigma_f^2),     log sigma_f ~ Normal(log 3, 0.7^2)
    P_m ~ Dirichlet(K c b),   b ~ Dirichlet(1, ..., 1),       log c ~ Normal(log 1, 0.5^2)

One b is shared by the models that intend the same outcome, or by all where none is intended. So
outcomes that are rare in all models are expected to be rare in one that nobody has seen, and one
large weight makes no other large. sigma_f is integrated out by quadrature, c and b are sampled.
The point estimate of `fit_mdce_serd` has one sigma and b = 1/K (`serd_core.bayes.strengths`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.dynamics.outcome_models import OutcomeModels

#: Median of each strength and spread of its logarithm, whose density is normal: sigma in nats over
#: the range of a feature, c in observations, rho a factor, that of log mean dwell times in nats.
HYPERPRIORS = {
    "deviation": (3.0, 0.7),
    "pseudo_count": (1.0, 0.5),
    "intended_ratio": (1.0, 1.5),
    "dwell_deviation": (1.0, 0.5),
}
#: Scales over which the density of a weight is averaged, and their shares, by Gauss and Hermite.
_NODES, _SHARES = np.polynomial.hermite_e.hermegauss(24)
#: Largest standard deviation of a step of log c and log b.
STRIDE = 1.0


@dataclass(frozen=True, eq=False)
class Scales:
    """The prior of reward weights whose scales are integrated out; ranges: (F,) of the features."""

    ranges: FloatArray

    def log_density(self, weights: FloatArray) -> FloatArray:
        """(n,) log density of (n, F) weights, up to a constant."""
        median, spread = HYPERPRIORS["deviation"]
        log_scale = np.log(median) + spread * _NODES
        u = (weights * self.ranges)[..., None] / np.exp(log_scale)
        each = np.log(_SHARES / _SHARES.sum()) - log_scale - 0.5 * u**2
        return np.asarray(np.logaddexp.reduce(each, axis=-1).sum(axis=-1))

    def deviations(self) -> FloatArray:
        """(F,) standard deviations of the weights: E[sigma^2] of a log-normal sigma."""
        median, spread = HYPERPRIORS["deviation"]
        return np.asarray(median * np.exp(spread**2) / self.ranges)


@dataclass(frozen=True, eq=False)
class BaseMeasures:
    """Strengths of the Dirichlet prior in n chains.

    kind: (M,) number of the base measure b that a model has, of G; log_count: (n,) log c; energies:
    (n, G, K) z of b = softmax(z), where exp(z) are independent gamma variables of shape 1.
    """

    kind: IntArray
    log_count: FloatArray
    energies: FloatArray

    @classmethod
    def of(cls, models: OutcomeModels, pseudo_count: float, n: int) -> "BaseMeasures":
        """Those in which all outcomes have one pseudo-count."""
        kind = np.zeros(models.n_models, dtype=np.int64)
        if models.intended is not None:
            kind = np.unique(models.intended, return_inverse=True)[1].reshape(-1)
        shape = n, int(kind.max()) + 1, models.n_outcomes
        return cls(kind, np.full(n, np.log(pseudo_count)), np.zeros(shape))

    @property
    def pseudo_counts(self) -> FloatArray:
        """(n, M, K) K c b."""
        shares = np.exp(self.energies - np.logaddexp.reduce(self.energies, axis=2, keepdims=True))
        total = shares.shape[2] * np.exp(self.log_count)
        return np.asarray((total[:, None, None] * shares)[:, self.kind])

    def log_density(self) -> FloatArray:
        """(n,) log density of log c and z, up to a constant."""
        median, spread = HYPERPRIORS["pseudo_count"]
        of_count = -0.5 * ((self.log_count - np.log(median)) / spread) ** 2
        return np.asarray(of_count + np.sum(self.energies - np.exp(self.energies), axis=(1, 2)))

    def moved(self, rng: np.random.Generator) -> "BaseMeasures":
        """A normal step of all numbers, of a random length."""
        stride = STRIDE * rng.random((len(self.log_count), 1, 1))
        energies = self.energies + stride * rng.standard_normal(self.energies.shape)
        step = 0.5 * stride[:, 0, 0] * rng.standard_normal(len(stride))
        return BaseMeasures(self.kind, self.log_count + step, energies)

    def replaced(self, rows: BoolArray, other: "BaseMeasures") -> "BaseMeasures":
        """The same with some chains (n,) of another."""
        return BaseMeasures(
            self.kind,
            np.where(rows, other.log_count, self.log_count),
            np.where(rows[:, None, None], other.energies, self.energies),
        )


def log_dirichlet_density(logs: FloatArray, counts: FloatArray) -> FloatArray:
    """(n,) sum over models of log Dirichlet(counts) at (n, M, K) log probabilities."""
    of_models = gammaln(counts.sum(axis=2)) + np.sum(counts * logs - gammaln(counts), axis=2)
    return np.asarray(of_models.sum(axis=1))
