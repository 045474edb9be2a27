"""The automatic choice of the linear solver against each solver by hand, on graphs of many kinds.

Measured is one gradient of the log posterior, cold (the Bellman equation from nothing) and warm
(from the values of weights that are one per cent smaller), in processor time of one thread. A ratio
is the time of `Automatic` over that of the fastest solver by hand. Each action leads to one of its
state's neighbours with probability 0.9, else to any of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from lab.benchmarks.learning.gridworld_problems import objective_of
from lab.benchmarks.measurement import best_of
from lab.benchmarks.report import measured_rows, save
from serd_core.arrays import FloatArray, IntArray
from serd_core.bellman.linear.automatic import Automatic
from serd_core.bellman.linear.krylov import Krylov
from serd_core.bellman.linear.linear_solver import LinearSolver
from serd_core.bellman.linear.lu import BandedLu, SparseLu
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.start import starting_parameters
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem

SIZES = (600, 2_500, 10_000)
DISCOUNTS = (0.9, 0.99, 0.9999)
AHEAD = 0.9
WEIGHTS = np.array([1.0, 1.0])
BY_HAND: dict[str, LinearSolver] = {
    "band": BandedLu(),
    "LU": SparseLu(),
    "BiCGSTAB": Krylov(max_iterations=3_000),
    "BiCGSTAB, incomplete LU": Krylov(fill=10.0),
}
#: Limits beyond which a solver by hand takes minutes and never is the fastest.
WIDEST_BAND, MOST_FILL_STATES = 300, 3_000


def grid(n_states: int) -> IntArray:
    """Square of cells with four neighbours."""
    return _lattice(round(n_states ** (1 / 2)), 2)


def cube(n_states: int) -> IntArray:
    """Cube of cells with six neighbours."""
    return _lattice(round(n_states ** (1 / 3)), 3)


def random_graph(n_states: int) -> IntArray:
    """Four successors anywhere."""
    rng = np.random.default_rng(0)
    return np.column_stack([np.arange(n_states), rng.integers(n_states, size=(n_states, 4))])


def small_world(n_states: int) -> IntArray:
    """A ring in which one state of twenty leads anywhere."""
    successors, rng = ring(n_states), np.random.default_rng(0)
    far = rng.random(n_states) < 0.05
    successors[far, 4] = rng.integers(n_states, size=int(far.sum()))
    return successors


def ring(n_states: int) -> IntArray:
    """One or two steps either way around."""
    return (np.arange(n_states)[:, None] + np.array([0, 1, -1, 2, -2])) % n_states


def chain(n_states: int) -> IntArray:
    """A line whose ends hold; the first state is absorbing."""
    successors = np.arange(n_states)[:, None] + np.array([0, 1, -1, 2, -2])
    successors[0] = 0
    return np.clip(successors, 0, n_states - 1)


def tree(n_states: int) -> IntArray:
    """To the parent or to one of two children."""
    own = np.arange(n_states)
    children = [np.where(2 * own + side < n_states, 2 * own + side, own) for side in (1, 2)]
    return np.column_stack([own, np.maximum(own - 1, 0) // 2, *children, own])


def star(n_states: int) -> IntArray:
    """Rings of as many states as there are rings, each around a centre; the centres around one."""
    own, size = np.arange(n_states), round(n_states**0.5)
    centre = own // size * size
    next_on_ring = np.minimum(np.where(own % size == size - 1, centre, own + 1), n_states - 1)
    return np.column_stack([own, centre, next_on_ring, np.where(own == centre, 0, own), centre])


def hub(n_states: int) -> IntArray:
    """A chain each state of which may lead to the first one."""
    own = np.arange(n_states)
    steps = np.clip(own[:, None] + np.array([0, 1, -1]), 0, n_states - 1)
    return np.column_stack([steps, np.zeros(n_states, dtype=np.int64)])


GRAPHS: dict[str, Callable[[int], IntArray]] = {
    "grid": grid,
    "cube": cube,
    "random graph": random_graph,
    "small world": small_world,
    "ring": ring,
    "chain": chain,
    "tree": tree,
    "star": star,
    "hub": hub,
}


def run() -> None:
    """Measure every case and write the table."""
    cases = (
        {"graph": graph, "size": n_states, "discount": discount}
        for graph, n_states, discount in product(GRAPHS, SIZES, DISCOUNTS)
    )
    rows = measured_rows("solvers", cases, measure)
    ratios: FloatArray = np.array([[row["ratio, cold"], row["ratio, warm"]] for row in rows])
    details = {
        "cases": ratios.size,
        "within 1.5 of the fastest": int((ratios <= 1.5).sum()),
        "within 3 of the fastest": int((ratios <= 3.0).sum()),
        "largest ratio": float(ratios.max()),
    }
    save("solvers", "Automatic choice of the linear solver", rows, details)


@dataclass(frozen=True, eq=False)
class Case:
    """A problem with (A, K) dynamics, the same everywhere."""

    problem: TabularProblem
    dynamics: FloatArray

    def gradients(self, solver: LinearSolver) -> tuple[float, float]:
        """Seconds of a cold and of a warm gradient."""
        mdp = self.problem.mdp
        policy = np.full(mdp.available.shape, 1.0 / mdp.n_actions)
        starts = np.full(mdp.n_states, 1.0 / mdp.n_states)
        rng = np.random.default_rng(1)
        decisions = sample_decisions(
            mdp, policy, self.dynamics, starts, n_episodes=10, n_steps=20, rng=rng
        )
        posterior = objective_of(self.problem, decisions, solver)
        at, near = (
            starting_parameters(
                self.problem, posterior.policy_model, share * WEIGHTS, self.dynamics
            )
            for share in (1.0, 0.99)
        )
        before = posterior.evaluate(near).solution.value
        cold_s, _ = best_of(lambda: posterior.evaluate(at), at_least_s=0.2, calls=3)
        warm_s, _ = best_of(lambda: posterior.evaluate(at, before), at_least_s=0.2, calls=3)
        return cold_s, warm_s


def measure(graph: str, size: int, discount: float) -> dict[str, Any]:
    """The fastest solver by hand on one case, its times, and the ratios of the automatic choice."""
    case = case_of(GRAPHS[graph](size), discount)
    pattern = case.problem.mdp.engine.pattern
    times = {}
    for solver_name, solver in BY_HAND.items():
        too_wide = max(pattern.band.below, pattern.band.above) > WIDEST_BAND
        fills = graph == "random graph" and size > MOST_FILL_STATES
        if (solver_name == "band" and too_wide) or (fills and "LU" in solver_name):
            continue
        try:
            times[solver_name] = case.gradients(solver)
        except SerdError:
            continue  # it does not reach its residual
    automatic = case.gradients(Automatic())
    row: dict[str, Any] = {"states": pattern.n_states}
    for index, start in enumerate(("cold", "warm")):
        fastest = min(times, key=lambda each: times[each][index])
        row |= {f"fastest, {start}": fastest, f"ms, {start}": 1e3 * times[fastest][index]}
        row[f"ratio, {start}"] = automatic[index] / times[fastest][index]
    return row


def case_of(successors: IntArray, discount: float) -> Case:
    """A problem for (S, K) successors, with an action towards each."""
    n_states, n_actions = successors.shape
    models = OutcomeModels(
        np.repeat(successors[:, None, :], n_actions, axis=1),
        np.tile(np.arange(n_actions), (n_states, 1)),
        np.ones((n_states, n_actions), dtype=bool),
        n_actions,
    )
    # Rewards whose sums over the horizon vary as much at every discount.
    scale = np.sqrt(1.0 - discount)
    features = scale * np.random.default_rng(2).normal(size=(n_states, 1, len(WEIGHTS)))
    dynamics = np.full((n_actions, n_actions), (1.0 - AHEAD) / n_actions)
    dynamics += AHEAD * np.eye(n_actions)
    features = np.repeat(features, n_actions, axis=1)
    return Case(TabularProblem(Mdp(models, discount), features, ("a", "b")), dynamics)


def _lattice(side: int, n_dimensions: int) -> IntArray:
    shape = (side,) * n_dimensions
    place = np.indices(shape).reshape(n_dimensions, -1)
    columns = [np.arange(side**n_dimensions)]
    for axis in range(n_dimensions):
        for step in (1, -1):
            moved = place.copy()
            moved[axis] = np.clip(moved[axis] + step, 0, side - 1)
            columns.append(np.ravel_multi_index(tuple(moved), shape))
    return np.column_stack(columns)
