"""How strong priors are, found from the data: the maximum of Laplace's evidence.

    w_f ~ Normal(0, (sigma / range of f)^2),      P_m ~ Dirichlet(c, ..., c)

sigma and c maximise log P(D | strengths) plus the log of a wide log-normal density of each (MacKay
1992), without which few decisions would drive strengths to infinity.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, require_positive
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.posterior.beliefs import Belief, CoupledBelief
from serd_core.posterior.coordinates import feature_ranges
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import DirichletPrior
from serd_core.priors.prior import GaussianPrior, Prior, terms_of
from serd_core.semi_markov.dwell_likelihood import DwellPrior

#: Median of each strength and spread of its logarithm, whose density is normal: sigma in nats over
#: the range of a feature, c in observations, that of log mean dwell times in nats.
HYPERPRIORS = {
    "deviation": (3.0, 0.7),
    "pseudo_count": (1.0, 0.5),
    "dwell_deviation": (1.0, 0.5),
}


@dataclass(frozen=True)
class PriorByEvidence:
    """Proper priors whose strengths the decisions choose: normal on rewards, Dirichlet on dynamics.

    deviation: sigma of the weights; pseudo_count: c of the outcomes; dwell_deviation: sd of log
    mean dwell times around a common one, where moves take time (`DwellPrior`). None for the one of
    highest evidence; few laws hold hardly any evidence of their deviation, and a small one makes
    moves that nobody makes as fast as the others.
    """

    deviation: float | None = None
    pseudo_count: float | None = None
    dwell_deviation: float | None = 1.0

    def __post_init__(self) -> None:
        for name in ("deviation", "pseudo_count", "dwell_deviation"):
            if (value := getattr(self, name)) is not None:
                require_positive(f"{name} of PriorByEvidence", value, "use None to find it")

    def strengths(self, belief: Belief, *, timed: bool = False) -> "Strengths":
        """The strengths that a fit under the belief has; timed: whether moves take time."""
        given: dict[str, float | None] = {"deviation": self.deviation}
        if belief.learns_dynamics:
            given["pseudo_count"] = self.pseudo_count
            if timed:
                given["dwell_deviation"] = self.dwell_deviation
        if isinstance(belief, CoupledBelief):
            raise SerdError(
                "CoupledBelief has a prior that is no density, so it has no evidence; give"
                " fit_mdce_serd a prior"
            )
        return Strengths(belief, tuple(given.items()))


@dataclass(frozen=True)
class Strengths:
    """The strengths of a prior; given: by name, None for those to find."""

    belief: Belief
    given: tuple[tuple[str, float | None], ...]

    @property
    def open(self) -> tuple[str, ...]:
        """Names of those to find."""
        return tuple(name for name, value in self.given if value is None)

    @property
    def start(self) -> FloatArray:
        """(h,) logs of the medians of those to find."""
        return np.log([HYPERPRIORS[name][0] for name in self.open])

    @property
    def spreads(self) -> FloatArray:
        """(h,) spreads of the hyperpriors of those to find."""
        return np.array([HYPERPRIORS[name][1] for name in self.open])

    def log_density(self, logs: FloatArray) -> tuple[float, FloatArray]:
        """Log density of the hyperprior at (h,) logs of those to find, and its gradient."""
        away = (logs - self.start) / self.spreads
        values = -0.5 * away**2 - np.log(self.spreads * np.sqrt(2.0 * np.pi))
        return float(values.sum()), -away / self.spreads

    def values(self, logs: FloatArray) -> dict[str, float]:
        """All strengths by name, for (h,) logs of those to find."""
        found = dict(zip(self.open, np.exp(logs).tolist(), strict=True))
        return {name: found[name] if value is None else value for name, value in self.given}

    def logs(self, values: dict[str, float]) -> FloatArray:
        """(h,) logs of those to find, at the given values and otherwise at their medians."""
        medians = {name: median for name, (median, _) in HYPERPRIORS.items()}
        return np.log([(medians | values)[name] for name in self.open])

    def prior(self, problem: Problem, logs: FloatArray) -> Prior:
        """The prior of these strengths."""
        values = self.values(logs)
        deviations = values["deviation"] / feature_ranges(problem)
        prior: Prior = GaussianPrior(tuple(deviations.tolist()), Block.REWARD)
        blocks = [Block.TRUTH] if "pseudo_count" in values else []
        if (Block.BELIEF,) in self.belief.groups:
            blocks.append(Block.BELIEF)
        for block in blocks:
            prior = prior + DirichletPrior(values["pseudo_count"], block)
            if "dwell_deviation" in values:
                prior = prior + DwellPrior(values["dwell_deviation"], block)
        return prior


def strengths_of(prior: Prior, problem: Problem) -> dict[str, float]:
    """The strengths by name that a prior by evidence has."""
    found: dict[str, float] = {}
    for term in terms_of(prior):
        if isinstance(term, GaussianPrior):
            widths = np.atleast_1d(term.standard_deviation) * feature_ranges(problem)
            found["deviation"] = float(widths[0])
        elif isinstance(term, DirichletPrior):
            found["pseudo_count"] = term.pseudo_count
        elif isinstance(term, DwellPrior):
            found["dwell_deviation"] = term.deviation
    return found
