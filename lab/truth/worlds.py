"""False claims over simulated worlds: what a headline states beside what is true of its policy.

A world is a grid, an expert and true dynamics, which a model may not be able to express. A headline
is wrong where the share that arrives is off by more than 0.1, or half arrive at a time that is off
by more than a quarter. It is withheld for nothing where the forecast would have been right.
The families were written after the rules of the checks (`serd_app.learning.criticism`) were fixed
on ten others.
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


def _wall(rng: np.random.Generator, n_gaps: int) -> BoolArray:
    """A wall across the room with gaps of one cell, at least two cells apart."""
    free = _open(rng, 9, 7)
    free[free.shape[0] // 2] = False
    places = 1 + 3 * rng.permutation(free.shape[1] // 3)[:n_gaps]
    free[free.shape[0] // 2, places] = True
    return free


def _pillars(rng: np.random.Generator) -> BoolArray:
    """Squares of four cells that are not free, in a pattern."""
    free = _open(rng, 10, 8)
    for row in range(2, free.shape[0] - 2, 4):
        for column in range(2, free.shape[1] - 1, 4):
            free[row : row + 2, column : column + 2] = False
    return free


def _patch(rng: np.random.Generator) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """A disc anywhere between start and goal, slower by a factor of two to four."""
    x, y = rng.uniform(0.2, 0.8, 2)
    factor, reach = rng.uniform(2.0, 4.0), rng.uniform(0.2, 0.35)
    return lambda east, north: np.where(np.hypot(east - x, north - y) < reach, factor, 1.0)


def _band(rng: np.random.Generator) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Rows of the room that are half as slow again up to three times as slow."""
    begin, factor = rng.uniform(0.2, 0.6), rng.uniform(1.5, 3.0)
    return lambda _, north: np.where(np.abs(north - begin - 0.1) < 0.1, factor, 1.0)


FAMILIES: dict[str, Callable[[np.random.Generator], World]] = {
    "slow patch": lambda rng: World(_open(rng, 10, 8), pace=_patch(rng)),
    "patch and pillars": lambda rng: World(_pillars(rng), pace=_patch(rng)),
    "slow rows": lambda rng: World(_open(rng), pace=_band(rng)),
    "one door": lambda rng: World(_wall(rng, 1), (0.08, 0.82, 0.05, 0.0, 0.05)),
    "two doors, one slow": lambda rng: World(
        _wall(rng, 2), pace=lambda east, _: np.where(east < 0.5, 2.5, 1.0)
    ),
    "sticky": lambda rng: World(_pillars(rng), (0.25, 0.69, 0.03, 0.0, 0.03)),
    "belief too shy": lambda rng: World(_open(rng), believed=(0.1, 0.6, 0.15, 0.0, 0.15)),
    "five drives": lambda rng: World(_wall(rng, 2), (0.06, 0.8, 0.07, 0.0, 0.07), n_drives=5),
    "wanders": lambda rng: World(_pillars(rng), at_random=0.3),
    "drift": lambda rng: World(_pillars(rng), (0.05, 0.75, 0.18, 0.0, 0.02), n_drives=16),
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
