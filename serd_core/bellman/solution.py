"""The record every Bellman solver returns, with its certificate.

T is a gamma-contraction in the largest norm, so any V satisfies

    max |V - V*| <= max |T V - V| / (1 - gamma),

which holds whatever the solver did: the bound needs the residual only.
"""

from dataclasses import dataclass

from serd_core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class BellmanSolution:
    """A solved (or honestly unsolved) Bellman equation.

    value: (S,); q: (S, A), -inf where unavailable; policy: (S, A) derivative of the maximum.
    steps: operator applications; linear_solves: Newton corrections among them.
    residual: max |T V - V|; error_bound: residual / (1 - gamma) >= max |V - V*|.
    converged: whether the residual reached the solver's target.
    """

    value: FloatArray
    q: FloatArray
    policy: FloatArray
    steps: int
    linear_solves: int
    residual: float
    error_bound: float
    converged: bool
