"""The record every Bellman solver returns, with its certificate.

T is a gamma-contraction in the largest norm. Arithmetic gives T V only up to some rounding d, so
the computed T V, which is the value handed back, satisfies

    max |computed T V - V*| <= (max |computed T V - V| + d) / (1 - gamma),

which holds whatever the solver did: the bound needs the residual and the size of numbers only. V*
solves the equation as given: with these rewards and transitions, whose rows sum to 1.
"""

from dataclasses import dataclass

from serd_core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class BellmanSolution:
    """A solved (or honestly unsolved) Bellman equation.

    value: (S,); q: (S, A), -inf where unavailable; policy: (S, A) derivative of the maximum.
    steps: operator applications; linear_solves: Newton corrections among them.
    residual: max |T V - V|, as computed.
    error_bound: (residual + rounding of one backup) / (1 - gamma) >= max |V - V*|.
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
