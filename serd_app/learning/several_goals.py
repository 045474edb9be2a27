"""Drives with several goals: one reward and one set of dynamics, and a copy of the place for each.

A copy has the cells of the place, and absorbs in the goal of its own drives. Copies are stacked in
one problem with a wall between two of them, so that every method learns from all drives at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from serd_app.demonstrations.decision_table import concatenate
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import NavigationProblem
from serd_core.mdp.mdp import Mdp
from serd_core.semi_markov.models import require_timed, semi_markov_problem

#: Share of the decisions that the goals are to leave, and most goals that are taken.
ENOUGH, MOST_GOALS = 0.9, 12
#: Widths of goals that are tried, as shares of the diagonal of the grid.
_WIDTHS = 1 / 4, 1 / 8, 1 / 16


@dataclass(frozen=True, eq=False)
class GoalDrives:
    """problem: with one goal, whose decisions take time; decisions: of drives to it, up to it."""

    problem: NavigationProblem
    decisions: TimedDecisions


def goals_of_ends(
    ends: IntArray, grid: Grid, groups: Sequence[IntArray], left_by: Callable[[IntArray], int]
) -> list[IntArray]:
    """States of each goal, the one that leaves most decisions first.

    ends: states in which drives end; groups: the neighbouring ones of these; left_by: how many
    decisions a goal leaves to those who end there. The first division of the ends that leaves nine
    in ten decisions is taken, else the best one: neighbouring ends, or ends within a share of the
    diagonal of the grid (complete linkage).
    """
    divisions = [list(groups)]
    if len(ends) > 1:
        tree = linkage(grid.centers_m[ends], "complete")
        diagonal_m = float(np.linalg.norm(np.ptp(grid.centers_m, axis=0)))
        for share in _WIDTHS:
            number = fcluster(tree, share * diagonal_m, "distance")
            divisions.append([ends[number == each] for each in np.unique(number)])
    best: tuple[int, list[IntArray]] = 0, list(groups)[:1]
    total = left_by(np.zeros(0, dtype=np.int64))
    for division in divisions:
        ranked = sorted(((left_by(goal), n) for n, goal in enumerate(division)), reverse=True)
        ranked = [each for each in ranked[:MOST_GOALS] if each[0]]
        n_left = sum(count for count, _ in ranked)
        if n_left > best[0]:
            best = n_left, [division[n] for _, n in ranked]
        if n_left >= ENOUGH * total:
            break
    return best[1]


def in_one_problem(goals: Sequence[GoalDrives]) -> tuple[NavigationProblem, TimedDecisions]:
    """Stack the problems of the goals, and return the decisions in the states of their copies."""
    first = goals[0].problem
    if len(goals) == 1:
        return first, goals[0].decisions
    n, copies = first.mdp.n_states, range(len(goals))
    problems = [each.problem for each in goals]
    of_copies = [each.outcome_models for each in problems]
    models = replace(
        first.outcome_models,
        successors=np.concatenate([of_copies[k].successors + k * n for k in copies]),
        model_of=np.concatenate([each.model_of for each in of_copies]),
        available=np.concatenate([each.available for each in of_copies]),
    )
    with_wall = np.pad(first.grid.walkable, ((0, 1), (0, 0)))
    stacked = NavigationProblem(
        grid=Grid(
            first.grid.origin_m, first.grid.cell_size_m, np.concatenate([with_wall] * len(goals))
        ),
        flow=np.tile(first.flow, len(goals)),
        goal_states=np.concatenate([problems[k].goal_states + k * n for k in copies]),
        mdp=Mdp(models, first.mdp.discount),
        outcome_models=models,
        features=np.concatenate([each.features for each in problems]),
        feature_names=first.feature_names,
    )
    timed = require_timed(first.mdp.transitions)
    tables = [each.decisions for each in goals]
    return semi_markov_problem(stacked, law_of=timed.law_of, stay_s=timed.stay_s), concatenate(
        [
            replace(d, state=d.state + k * n, next_state=d.next_state + k * n)
            for k, d in enumerate(tables)
        ]
    )
