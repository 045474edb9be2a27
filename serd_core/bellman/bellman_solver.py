"""The Bellman equation, its solver with a certificate, and the gradient by the result.

    Q(s, a) = R(s, a) + gamma sum_s' P(s' | s, a) V(s'),    V(s) = T V(s) = maximum over Q(s, .)

Soft (maximum discounted causal entropy, Eqs. 3.28 to 3.30): V(s) = log sum_a exp Q(s, a) and
pi(a | s) = exp(Q(s, a) - V(s)). Hard (Eqs. 2.24 to 2.26): V(s) = max_a Q(s, a) and pi greedy. T is
convex and monotone, and a gamma-contraction whose derivative by V is gamma P_pi. So with rounding d

    max |computed T V - V*| <= (max |computed T V - V| + d) / (1 - gamma)

where gamma is multiplied by the largest sum of a row where moves take time. Newton's method, which
is (soft) policy iteration, is V <- V + (I - gamma P_pi)^-1 (T V - V). From the second step on V
grows at least as fast as under value iteration, and close to V* quadratically. A sweep replaces
every step that went wrong numerically, and steps that shrink the residual well keep their matrix.

The gradient by every reward and transition probability takes one transposed solve, the transpose of
the Q-gradient (4.21), (4.66) of the thesis. With g(s, a) = dJ/dQ(s, a) at the converged Q:

    (I - gamma P_pi^T) y = gamma P^T g,    lambda(s, a) = g(s, a) + pi(a | s) y(s)
    dJ/dR(s, a) = lambda(s, a),            dJ/dP(s' | s, a) = gamma lambda(s, a) V(s')
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from serd_core.arrays import FloatArray, largest_per_row, sum_per_row
from serd_core.bellman.linear_solvers import LinearSystem, kind_of
from serd_core.checks import require_each
from serd_core.dynamics.transition_model import Transitions
from serd_core.mdp.mdp import Mdp


class BellmanEquation(ABC):
    """A maximum over actions and its derivative; Q is -inf where an action is unavailable.

    curved: whether the maximum has second derivatives; they are then those of log-sum-exp.
    """

    curved: ClassVar[bool]

    @abstractmethod
    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) maximum over the actions of (S, A) values."""

    @abstractmethod
    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) derivative of the maximum: the policy along which gradients propagate."""

    def policy_at(self, q: FloatArray, maximum: FloatArray) -> FloatArray:
        """The same for a known maximum, whose rounding error each probability then has."""
        del maximum
        return self.policy(q)


@dataclass(frozen=True)
class SoftBellman(BellmanEquation):
    """Log-sum-exp over actions; its derivative is the Boltzmann policy."""

    curved = True

    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) log sum_a exp Q(s, a) (3.29)."""
        highest = largest_per_row(q)
        shifted = np.exp(q - highest[:, None])
        return np.asarray(highest + np.log(sum_per_row(shifted)))

    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) Boltzmann distribution over Q (3.30)."""
        return boltzmann(q, 1.0)

    def policy_at(self, q: FloatArray, maximum: FloatArray) -> FloatArray:
        policy = q - maximum[:, None]
        return np.exp(policy, out=policy)


def boltzmann(q: FloatArray, temperature: float) -> FloatArray:
    """(S, A) probabilities proportional to exp(Q(s, a) / temperature) (4.62)."""
    shifted = np.exp((q - largest_per_row(q)[:, None]) / temperature)
    return np.asarray(shifted / sum_per_row(shifted)[:, None])


@dataclass(frozen=True)
class HardBellman(BellmanEquation):
    """Maximum over actions; a derivative is the greedy policy (a sub-derivative at ties)."""

    curved = False

    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) max_a Q(s, a) (2.25)."""
        return largest_per_row(q)

    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) greedy policy (2.26), the first of equal actions."""
        greedy = np.zeros_like(q)
        greedy[np.arange(len(q)), q.argmax(axis=1)] = 1.0
        return greedy


#: Values beyond overflow in sums and differences.
LARGEST_VALUE = 1e300
EPSILON = float(np.finfo(np.float64).eps)
#: Multiple of the rounding unit below which a residual cannot be expected to fall.
ROUNDING_STEPS = 16.0
SMALLEST_SHARE = ROUNDING_STEPS * EPSILON


@dataclass(frozen=True, eq=False)
class BellmanProblem:
    """Everything T depends on: the equation, (S, A) rewards, transitions, and their MDP."""

    equation: BellmanEquation
    rewards: FloatArray
    transitions: Transitions
    mdp: Mdp

    def __post_init__(self) -> None:
        available = self.mdp.available
        allowed = np.where(available, self.rewards, 0.0)
        largest = LARGEST_VALUE * (1.0 - self.contraction)
        rule = f"be finite and at most {largest:.3g} in size"
        fix = "use smaller weights or features, and mark forbidden actions unavailable"
        require_each("rewards", allowed, np.abs(allowed) <= largest, rule, fix)
        object.__setattr__(self, "rewards", np.where(available, self.rewards, -np.inf))

    @cached_property
    def contraction(self) -> float:
        """Modulus of T: gamma, less or more where moves take time."""
        filled = self.transitions
        return self.mdp.discount * filled.model.largest_sum(filled.local_probabilities)


@dataclass(frozen=True, eq=False)
class Backup:
    """T V at one V: (S,) value = V, target = T V, (S, A) Q of V, and the largest |T V - V|."""

    value: FloatArray
    target: FloatArray
    q: FloatArray
    residual: float

    @cached_property
    def gap(self) -> FloatArray:
        """(S,) T V - V."""
        return self.target - self.value

    @cached_property
    def scale(self) -> float:
        """max(1, max |T V|): what sizes and accuracies of values are relative to."""
        return max(1.0, float(self.target.max()), -float(self.target.min()))


def backup(problem: BellmanProblem, value: FloatArray) -> Backup:
    """Apply the Bellman operator once."""
    q = problem.transitions.expected(value)
    q *= problem.mdp.discount
    q += problem.rewards
    target = problem.equation.maximum(q)
    gap = target - value
    return Backup(value, target, q, max(float(gap.max()), -float(gap.min())))


@dataclass(frozen=True, eq=False)
class BellmanSolution:
    """The end of a Bellman iteration, converged or not.

    value: (S,); q: (S, A), -inf where unavailable; equation: the one that was solved.
    steps: operator applications; linear_solves: Newton corrections among them.
    residual: max |T V - V|, as computed.
    error_bound: (residual + rounding of one backup) / (1 - gamma) >= max |V - V*|.
    converged: whether the residual reached the solver's target.
    """

    value: FloatArray
    q: FloatArray
    equation: BellmanEquation
    steps: int
    linear_solves: int
    residual: float
    error_bound: float
    converged: bool

    @cached_property
    def policy(self) -> FloatArray:
        """(S, A) derivative of the maximum."""
        policy = self.equation.policy(self.q)
        policy.flags.writeable = False
        return policy


def is_accurate(problem: BellmanProblem, accuracy: float, last: Backup) -> bool:
    """Whether a solver may stop, for an error of accuracy * max(1, max |V|)."""
    share = max(accuracy * (1.0 - problem.contraction), SMALLEST_SHARE)
    return last.residual <= last.scale * share


def solution_from(
    problem: BellmanProblem, last: Backup, *, steps: int, linear_solves: int, converged: bool
) -> BellmanSolution:
    """Record of a finished iteration; the value is T V, no further from V* than V was.

    For K transitions in the longest row, A actions and the unit u = eps / 2, a row of P V, its
    discount and reward cost (K + 2) u max |V|, the sum of exponentials (A + log A + 4) u, and
    adding its logarithm u max |V|. Actions far below the best one have large errors in Q, and a
    weight that makes up for them.
    """
    model = problem.transitions.model
    n_terms = int(model.row_length.max()) + model.n_actions + 3
    certified = last.residual + n_terms * EPSILON * (last.scale + last.residual)
    return BellmanSolution(
        value=last.target,
        q=last.q,
        equation=problem.equation,
        steps=steps,
        linear_solves=linear_solves,
        residual=last.residual,
        error_bound=certified / (1.0 - problem.contraction),
        converged=converged,
    )


@dataclass(frozen=True, eq=False)
class Adjoint:
    """dJ/dR as (S, A), dJ/d(local probabilities of P), and the state part y as (S,)."""

    reward_gradient: FloatArray
    local_gradient: FloatArray
    state_gradient: FloatArray


def adjoint(
    mdp: Mdp,
    transitions: Transitions,
    solution: BellmanSolution,
    q_gradient: FloatArray,
) -> Adjoint:
    """Gradient of an objective with the given (S, A) gradient by the converged Q."""
    policy = solution.policy
    system = policy_system(transitions, policy, mdp.discount)
    flow = mdp.discount * transitions.flow(q_gradient)
    state_gradient = system.solve(flow, transposed=True)
    del system  # frees the memory of its factor
    reward_gradient = policy * state_gradient[:, None]
    reward_gradient += q_gradient
    by_local = transitions.local_gradient(reward_gradient, solution.value)
    return Adjoint(reward_gradient, mdp.discount * by_local, state_gradient)


def policy_system(
    transitions: Transitions, policy: FloatArray, discount: float, right_sides: int = 1
) -> LinearSystem:
    """I - discount * P_pi for an (S, A) policy, for so many right-hand sides."""
    pattern = transitions.model.policy_pattern
    data = pattern.system_data(policy, transitions.entries, discount)
    return kind_of(pattern, right_sides)(pattern, data)


#: Relative residual an iterative solver may leave in a correction; the next step removes it. A
#: third fewer products with the matrix than with 1e-3 at 100,000 states.
FORCING = 3e-2
#: Share of the residual by which values may fall in a step that counts as rising.
FALL = 1e-2
#: A step that shrinks the residual to this share was good enough to keep its matrix.
KEEP = 0.03


@dataclass(frozen=True)
class Newton:
    """Solves the Bellman equation by Newton's method, safeguarded by sweeps.

    accuracy: wanted error of V relative to max(1, max |V|).
    max_steps: bound of sweeps and Newton steps together; cold_sweeps: sweeps before a cold start.
    """

    accuracy: float = 1e-12
    max_steps: int = 1_000
    cold_sweeps: int = 2

    def solve(
        self, problem: BellmanProblem, initial_value: FloatArray | None = None
    ) -> BellmanSolution:
        """Solve from `initial_value`, or from zero after `cold_sweeps` sweeps."""
        start = np.zeros(problem.mdp.n_states) if initial_value is None else initial_value
        latest = backup(problem, start)
        sweeps_due = self.cold_sweeps if initial_value is None else 0
        steps, linear_solves = 1, 0
        system: LinearSystem | None = None
        while not (done := is_accurate(problem, self.accuracy, latest)) and steps < self.max_steps:
            steps += 1
            if sweeps_due > 0:
                latest, sweeps_due = backup(problem, latest.target), sweeps_due - 1
                continue
            linear_solves += 1
            if system is None:
                policy = problem.equation.policy_at(latest.q, latest.target)
                system = policy_system(problem.transitions, policy, problem.mdp.discount)
            step = system.solve(latest.gap, relative_residual=FORCING)
            proposed = backup(problem, latest.value + step)
            system = system if proposed.residual <= KEEP * latest.residual else None
            if _acceptable(proposed, latest):
                latest = proposed
            else:
                latest, sweeps_due = backup(problem, latest.target), self.cold_sweeps
        return solution_from(
            problem, latest, steps=steps, linear_solves=linear_solves, converged=done
        )


def _acceptable(proposed: Backup, latest: Backup) -> bool:
    """Whether a step may be kept: it shrank the residual, or values rose monotonically."""
    if not np.isfinite(proposed.residual):
        return False
    rises = float(np.min(proposed.gap)) >= -FALL * proposed.residual
    return proposed.residual < latest.residual or rises
