"""False claims over simulated worlds: what a headline states beside what is true of its policy.

A world is a grid, an expert and true dynamics, which a model may not be able to express. A headline
is wrong where the share that arrives is off by more than 0.1, or half arrive at a time that is off
by more than a quarter. It is withheld for nothing where the forecast would have been right.
The families were written after the rules of the checks (`serd_app.learning.criticism`) were fixed
on others.
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
    AGAINST_FLOW,
    GOAL,
    NO_FLOW,
    WAITING,
    WALL_DISTANCE,
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
    """free: (R, C); outcomes: stay, forward, right, back, left of a move.

    against: those of moves against people, who walk north in the west and south in the east; none
    where nobody walks. pace: factor of dwell times at places east, from 0 to 1 over the place;
    shape: of their gamma laws. strength, off_walls: weights of the expert. starts: share of the
    place, from the south, in which drives begin. n_drives: that are recorded.
    """

    free: BoolArray
    outcomes: tuple[float, ...] = (0.04, 0.9, 0.03, 0.0, 0.03)
    against: tuple[float, ...] = ()
    pace: Callable[[FloatArray], FloatArray] = np.ones_like
    shape: float = 6.0
    strength: float = 3.5
    off_walls: float = 0.0
    starts: float = 0.0
    n_drives: int = _N_DRIVES


def _open(rng: np.random.Generator, rows: int = 9, columns: int = 7) -> BoolArray:
    return np.ones((rows + int(rng.integers(3)), columns + int(rng.integers(3))), dtype=bool)


def _ring(rng: np.random.Generator) -> BoolArray:
    """A block in the middle, with two or three cells around it."""
    free, around = _open(rng), int(rng.integers(2, 4))
    free[around:-around, around:-around] = False
    return free


def _pocket(rng: np.random.Generator) -> BoolArray:
    """Three walls that are open to the south, in the way of most drives."""
    free = _open(rng, 11, 8)
    free[4:8, 1] = free[4:8, -2] = free[7, 1:-1] = False
    return free


def _lanes(rng: np.random.Generator) -> BoolArray:
    """A wall along the way, with a door in its middle."""
    free = _open(rng, 12, 6)
    free[2:-2, free.shape[1] // 2] = False
    free[free.shape[0] // 2, free.shape[1] // 2] = True
    return free


_SLIPS = (0.06, 0.8, 0.07, 0.0, 0.07)
FAMILIES: dict[str, Callable[[np.random.Generator], World]] = {
    "ring": lambda rng: World(_ring(rng)),
    "pocket": lambda rng: World(_pocket(rng), _SLIPS),
    "uneven floor": lambda rng: World(
        _open(rng), pace=lambda east: np.exp(rng.normal(0.0, 0.5, len(east)))
    ),
    "erratic times": lambda rng: World(_open(rng), shape=1.2),
    "with and against people": lambda rng: World(_open(rng), against=(0.4, 0.5, 0.05, 0.0, 0.05)),
    "always the best": lambda rng: World(_ring(rng), _SLIPS, strength=40.0),
    "keeps off walls": lambda rng: World(_pocket(rng), off_walls=-1.0),
    "four drives": lambda rng: World(_ring(rng), _SLIPS, n_drives=4),
    "lanes, one slow": lambda rng: World(
        _lanes(rng), pace=lambda east: np.where(east < 0.5, 2.0, 1.0)
    ),
    "starts anywhere": lambda rng: World(_pocket(rng), _SLIPS, starts=0.6),
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
    pace = np.array(outcome.model.pace or np.ones(learned.mdp.n_states))
    paced = semi_markov_problem(learned, log_pace=np.log(pace))
    plan = plan_of(paced, outcome.fit, draws, _TIMEOUT_S)
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
    of_people = np.where(east < east.mean(), int(Action.NORTH), int(Action.SOUTH))
    by_decisions = build_navigation_problem(
        grid=grid,
        flow=of_people if world.against else np.full(grid.n_states, NO_FLOW),
        goal_states=np.flatnonzero(north == north.max()),
        wall_distance_m=grid_wall_distance_m(grid),
        discount=_DISCOUNT,
    )
    timed = with_dwell_times(by_decisions, patience_s=4.0, wait_s=1.0)
    learned, _ = with_chosen_features(timed, {}, walls_seen=True)
    pace = world.pace((east - east.min()) / np.ptp(east))
    return learned, semi_markov_problem(learned, log_pace=np.log(pace))


def _drives(
    world: World, true: NavigationProblem, rng: np.random.Generator
) -> tuple[TimedDecisions, FloatArray]:
    """What the expert does from the south of the place, and the true dynamics."""
    model = require_timed(true.mdp.transitions)
    table = np.tile(world.outcomes, (len(true.model_names), 1))
    table[AGAINST_FLOW] = world.against or world.outcomes
    table[WAITING] = [0.96, 0.01, 0.01, 0.01, 0.01]
    table = np.maximum(table, 1e-4)
    truth = model.parameters_from(table / table.sum(axis=1, keepdims=True), 1.0, world.shape)
    weights = np.zeros(len(true.feature_names))
    weights[true.feature_names.index(GOAL)] = world.strength
    weights[true.feature_names.index(WALL_DISTANCE)] = world.off_walls
    policy = soft_policy(true, weights, model.local_probabilities(truth)).probabilities
    north = true.grid.centers_m[:, 1] - true.grid.centers_m[:, 1].min()
    starts = (north <= world.starts * north.max()).astype(np.float64)
    decisions = sample_timed_decisions(
        true.mdp, policy, truth, starts / starts.sum(), n_episodes=world.n_drives, n_steps=200,
        rng=rng, mean_until_command_s=60.0,
    )  # fmt: skip
    return replace(decisions, source="world"), truth
