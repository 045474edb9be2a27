"""False claims over simulated worlds: what a headline states beside what is true of its policy.

A world is a grid, an expert and true dynamics, which a model may not be able to express. A headline
is wrong where the share that arrives is off by more than 0.1, or half arrive at a time that is off
by more than a quarter. It is withheld for nothing where the forecast would have been right.
The families were written after the rules of the checks (`serd_app.learning.criticism`) were fixed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from serd_app.learning.features import with_chosen_features
from serd_app.learning.recipe import LearningTask, learn, plan_of
from serd_app.learning.settings import LearningSettings
from serd_core.arrays import BoolArray, FloatArray
from serd_core.arrival.chain import timed_arrival
from serd_core.arrival.law import steps_within
from serd_core.demonstrations.decisions import TimedDecisions, start_distribution
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Action, Grid, grid_wall_distance_m
from serd_core.grid.navigation import (
    NO_FLOW,
    NavigationProblem,
    build_navigation_problem,
    with_dwell_times,
)
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.models import require_timed, semi_markov_problem
from serd_sim.drivers.strategy import STEP_S, dynamics_of_draws

_TIMEOUT_S, _DISCOUNT, _N_DRIVES = 120.0, 0.97, 10
#: By which a headline may be off: the share that arrives, and the time of half as a factor.
_SHARE, _FACTOR = 0.1, 1.25


@dataclass(frozen=True)
class World:
    """free: (R, C); outcomes: stay, forward, right, back, left of a move. believed: by the expert.

    pace: factor of dwell times at places east and north, from 0 to 1 over the place; at_random,
    waits: shares of the expert's decisions that are drawn evenly, and that wait. n_drives: that are
    recorded.
    """

    free: BoolArray
    outcomes: tuple[float, ...] = (0.04, 0.9, 0.03, 0.0, 0.03)
    believed: tuple[float, ...] = ()
    pace: Callable[[FloatArray, FloatArray], FloatArray] = lambda east, _: np.ones_like(east)
    at_random: float = 0.0
    waits: float = 0.0
    n_drives: int = _N_DRIVES


def _open(rng: np.random.Generator, rows: int = 8, columns: int = 7) -> BoolArray:
    return np.ones((rows + int(rng.integers(3)), columns + int(rng.integers(3))), dtype=bool)


def _zigzag(rng: np.random.Generator) -> BoolArray:
    """Walls from alternating sides, each with a gap of two or three cells at its end."""
    free = _open(rng, 11, 6)
    for number, row in enumerate(range(2, free.shape[0] - 1, 3)):
        gap = int(rng.integers(2, 4))
        wall = np.arange(free.shape[1]) >= gap
        free[row] = ~wall if number % 2 else ~wall[::-1]
    return free


def _scattered(rng: np.random.Generator) -> BoolArray:
    """Single cells that are not free, none of them beside another."""
    free = _open(rng, 10, 8)
    for _ in range(12):
        row, column = rng.integers(1, free.shape[0] - 1), rng.integers(1, free.shape[1] - 1)
        if free[row - 1 : row + 2, column - 1 : column + 2].all():
            free[row, column] = False
    return free


def _mud(east: FloatArray, north: FloatArray) -> FloatArray:
    return np.where(np.hypot(east - 0.6, north - 0.5) < 0.25, 3.0, 1.0)


def _slow_end(_: FloatArray, north: FloatArray) -> FloatArray:
    return np.where(north > 0.65, 2.0, 1.0)


def _quick_lane(east: FloatArray, _: FloatArray) -> FloatArray:
    return np.where(east < 0.3, 0.5, 1.0)


FAMILIES: dict[str, Callable[[np.random.Generator], World]] = {
    "mud": lambda rng: World(_open(rng, 10, 8), pace=_mud),
    "slower to the east": lambda rng: World(_scattered(rng), pace=lambda east, _: 2.0**east),
    "slow end": lambda rng: World(_scattered(rng), pace=_slow_end),
    "quick lane": lambda rng: World(_open(rng, 10, 8), pace=_quick_lane),
    "belief too bold": lambda rng: World(
        _scattered(rng), (0.1, 0.7, 0.1, 0.0, 0.1), believed=(0.01, 0.97, 0.01, 0.0, 0.01)
    ),
    "zigzag": lambda rng: World(_zigzag(rng), (0.06, 0.84, 0.05, 0.0, 0.05)),
    "long hall": lambda rng: World(_open(rng, 16, 3)),
    "six drives": lambda rng: World(_scattered(rng), (0.08, 0.82, 0.05, 0.0, 0.05), n_drives=6),
    "now and then": lambda rng: World(_zigzag(rng), at_random=0.15, waits=0.1),
    "wind": lambda rng: World(_open(rng), (0.05, 0.74, 0.0, 0.01, 0.2)),
}


@dataclass(frozen=True)
class Claim:
    """claimed, right: 1 where a headline states it, and where the forecast is true, else 0."""

    family: str
    seed: int
    claimed: int
    right: int
    share_claimed: float
    share_true: float
    half_claimed_s: float
    half_true_s: float
    failed: str


def claim(family: str, seed: int) -> Claim:
    """Learn from the drives of a world, and compare the forecast with the truth."""
    rng = np.random.default_rng([seed, *family.encode()])
    world = FAMILIES[family](rng)
    learned, true = _problems(world)
    decisions, truth = _drives(world, true, rng)
    task = LearningTask(learned, "", timeout_s=_TIMEOUT_S)
    try:
        outcome = learn(task, decisions, LearningSettings(discount=_DISCOUNT))
    except SerdError as error:
        return Claim(family, seed, 0, 0, 0.0, 0.0, 0.0, 0.0, str(error))
    starts = start_distribution(decisions, learned.mdp.n_states)
    draws = dynamics_of_draws("the model", outcome.model, learned)
    plan = plan_of(learned, outcome.fit, draws, _TIMEOUT_S)
    law, n_steps = plan.law_from(starts), steps_within(_TIMEOUT_S, STEP_S)
    arrival = timed_arrival(true, plan.policy.probabilities, truth, STEP_S, n_steps)
    cdf = arrival.cdf @ starts
    half_s, half_true_s = law.quantile_s(0.5) or np.inf, _half_s(cdf)
    right = abs(law.cdf[-1] - cdf[-1]) <= _SHARE and _close(half_s, half_true_s)
    failed = next((each.sentence for each in outcome.model.checks if each.mark == "fails"), "")
    numbers = float(law.cdf[-1]), float(cdf[-1]), float(half_s), half_true_s
    return Claim(family, seed, int(not failed), int(right), *numbers, failed)


def _half_s(cdf: FloatArray) -> float:
    reached = np.flatnonzero(cdf >= 0.5)
    return float(STEP_S * reached[0]) if len(reached) else float("inf")


def _close(one_s: float, other_s: float) -> bool:
    if not (np.isfinite(one_s) and np.isfinite(other_s)):
        return one_s == other_s
    return bool(max(one_s, other_s) <= _FACTOR * min(one_s, other_s) + STEP_S)


def _problems(world: World) -> tuple[NavigationProblem, NavigationProblem]:
    """The problem that is learned on, and the true one, in which places differ in pace."""
    grid = Grid((0.0, 0.0), 0.5, world.free)
    east, north = grid.centers_m.T
    by_decisions = build_navigation_problem(
        grid=grid,
        flow=np.full(grid.n_states, NO_FLOW),
        goal_states=np.flatnonzero(north == north.max()),
        wall_distance_m=grid_wall_distance_m(grid),
        discount=_DISCOUNT,
    )
    timed = with_dwell_times(by_decisions, patience_s=4.0, wait_s=1.0)
    learned, _ = with_chosen_features(timed, {}, walls_seen=True)
    at = (
        (each - each.min()) / max(float(np.ptp(each)), grid.cell_size_m) for each in (east, north)
    )
    return learned, semi_markov_problem(learned, log_pace=np.log(world.pace(*at)))


def _drives(
    world: World, true: NavigationProblem, rng: np.random.Generator
) -> tuple[TimedDecisions, FloatArray]:
    """What the expert does from the cells farthest from the goal, and the true dynamics."""
    model = require_timed(true.mdp.transitions)
    n_models = len(true.model_names)

    def dynamics(outcomes: tuple[float, ...]) -> FloatArray:
        table = np.tile(np.maximum(outcomes, 1e-4), (n_models, 1))
        table[-1] = [0.96, 0.01, 0.01, 0.01, 0.01]
        table /= table.sum(axis=1, keepdims=True)
        return model.parameters_from(table, 1.0, 6.0)

    truth, believed = dynamics(world.outcomes), dynamics(world.believed or world.outcomes)
    weights = np.zeros(len(true.feature_names))
    weights[0] = rng.uniform(2.0, 5.0)
    policy = soft_policy(true, weights, model.local_probabilities(believed)).probabilities
    available = true.outcome_models.available
    even = available / available.sum(axis=1, keepdims=True)
    wait = np.eye(available.shape[1])[Action.WAIT]
    share = 1.0 - world.at_random - world.waits
    policy = share * policy + world.at_random * even + world.waits * wait
    north = true.grid.centers_m[:, 1]
    starts = (north == north.min()).astype(np.float64)
    decisions = sample_timed_decisions(
        true.mdp, policy, truth, starts / starts.sum(), n_episodes=world.n_drives, n_steps=200,
        rng=rng, mean_until_command_s=60.0,
    )  # fmt: skip
    return replace(decisions, source="world"), truth
