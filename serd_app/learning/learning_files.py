"""Learning from files: a table of decisions and what `serd demos` wrote beside it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.ndimage import binary_dilation, label

from serd_app.demonstrations.decision_table import Place, files_beside, load_flow, load_learnable
from serd_app.errors import AppError
from serd_app.learning.features import read_own_features, with_chosen_features
from serd_app.learning.recipe import LearningTask
from serd_app.learning.settings import FlowSource
from serd_app.learning.several_goals import ENOUGH, GoalDrives, goals_of_ends
from serd_app.places.kept_scenario import own_scenario_yaml
from serd_app.places.map_scenario import FITTED, grid_scenario
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.grid.grid import Grid, grid_wall_distance_m
from serd_core.grid.navigation import (
    FEATURE_NAMES,
    NO_FLOW,
    NavigationProblem,
    build_navigation_problem,
    with_dwell_times,
)
from serd_sim.scenario.grid import flow_of, goal_states_of, wall_distance_of
from serd_sim.scenario.scenario import Scenario

_Table = TypeVar("_Table", bound=Decisions)


@dataclass(frozen=True, eq=False)
class LearningFiles:
    """task: where it was; flow_from: scenario, recorded or none; n_read: decisions of the table;
    n_after_goal: decisions left out; n_elsewhere: those of episodes that end in other places than
    the goals, also left out.
    goals_m: centres (x, y) of the goal cells; reaching: (E,) episodes that come to one. scenario:
    None where the grid was fitted.
    """

    task: LearningTask
    decisions: TimedDecisions
    flow_from: str
    goals_m: tuple[tuple[float, float], ...]
    n_read: int
    n_after_goal: int
    n_elsewhere: int
    reaching: IntArray
    scenario: Scenario | None = None

    def remarks(self) -> Iterable[str]:
        """A warning where no episode reaches the goal, with another that some reach."""
        if not len(self.reaching):
            goals = "; ".join(f"{x:g},{y:g}" for x, y in self.goals_m)
            n_left, (x_m, y_m) = max(self.task.other_goals, default=(0, (0.0, 0.0)))
            fix = "record episodes that arrive"
            if n_left:
                fix = f"name --goal {x_m:g},{y_m:g}, where some end after {n_left} decisions in all"
            yield (
                f"no episode reaches the goal ({goals}), so no arrival shows what it is worth;"
                f" {fix}"
            )


def read_learning_files(
    table: Path,
    *,
    discount: float,
    scenario: str = "",
    flow: FlowSource = "auto",
    goals_m: tuple[tuple[float, float], ...] = (),
    features: Path | None = None,
) -> LearningFiles:
    """Everything learning needs; FileError and AppError where the files contradict each other.

    scenario: in place of the one the record names. goals_m: places of the goal, by default the
    scenario's goal area, or without a scenario where most of the episodes end. features: file of
    own features.
    """
    all_decisions, place = load_learnable(table, scenario)
    grid, known = place.grid, place.scenario
    (goals, decisions), *further = _goals(all_decisions, place, goals_m)
    kept = until_goal(decisions, goals)
    chosen, source = _flow(files_beside(table)["flow"], place, flow)
    own = {} if features is None else read_own_features(features, grid, FEATURE_NAMES)
    problem, unused = _problem(place, chosen, goals, discount, own)
    drives = []
    for states, to_them in further:
        other = _problem(place, chosen, states, discount, own)[0]
        if other.feature_names == problem.feature_names:
            drives.append(GoalDrives(other, until_goal(to_them, states)))
    used = [decisions, *(each.decisions for each in drives)]
    reached = np.concatenate([each.episode for each in used])
    elsewhere = all_decisions.select(~np.isin(all_decisions.episode, reached))
    made = _scenario_of(place, problem, kept)
    n_used = len(kept) + sum(len(each.decisions) for each in drives)
    n_after_goal = len(all_decisions) - len(elsewhere) - n_used
    return LearningFiles(
        task=LearningTask(
            problem,
            known.name if known else "",
            own_flow=source != "scenario",
            other_goals=_other_goals(all_decisions, grid, goals),
            unused_features=unused,
            own_features={n: each for n, each in own.items() if n in problem.feature_names},
            scenario_yaml=made[0],
            timeout_s=made[1],
            other_drives=tuple(drives),
            left_out=_left_out(n_after_goal, len(elsewhere)),
        ),
        decisions=kept,
        flow_from=source,
        goals_m=_centres_m(grid, goals),
        n_read=len(all_decisions),
        n_after_goal=n_after_goal,
        n_elsewhere=len(elsewhere),
        reaching=episodes_reaching(decisions, goals),
        scenario=known,
    )


def _goals(
    decisions: TimedDecisions, place: Place, goals_m: tuple[tuple[float, float], ...]
) -> list[tuple[IntArray, TimedDecisions]]:
    """(G,) states of given places, else of the scenario, and all decisions; without both the goals
    in which drives end, with the decisions of those that end there."""
    grid = place.grid
    if goals_m:
        states = grid.states_at(np.array(goals_m))
        if (states < 0).any():
            x_m, y_m = goals_m[int(np.argmax(states < 0))]
            raise AppError(f"--goal must lie in a walkable cell of the grid, got {x_m:g},{y_m:g}")
        return [(np.unique(states), decisions)]
    if place.scenario:
        return [(goal_states_of(place.scenario, grid), decisions)]
    usual = usual_goal_states(decisions, grid)
    found = ending_in(decisions, usual)
    if len(until_goal(found, usual)) >= ENOUGH * len(decisions):
        return [(usual, found)]
    ends = np.unique(list(_ends(decisions).values()))

    def left_by(goal: IntArray) -> int:
        return len(until_goal(ending_in(decisions, goal), goal)) if len(goal) else len(decisions)

    goals = goals_of_ends(ends, grid, _neighbouring(ends, grid), left_by)
    return [(goal, ending_in(decisions, goal)) for goal in goals]


def _left_out(n_after_goal: int, n_elsewhere: int) -> str:
    whys = (n_after_goal, "after the goal"), (n_elsewhere, "of episodes that end elsewhere")
    return ", ".join(f"{count} {why}" for count, why in whys if count)


def _other_goals(
    decisions: TimedDecisions, grid: Grid, goals: IntArray
) -> tuple[tuple[int, tuple[float, float]], ...]:
    """How many decisions each other end of drives would leave as `--goal`, and its place."""
    ends = np.unique(list(_ends(decisions).values()))
    states = [
        int(group[0]) for group in _neighbouring(ends, grid) if not np.isin(group, goals).any()
    ]
    counts = (len(until_goal(decisions, np.array([state]))) for state in states)
    places = _centres_m(grid, np.array(states, dtype=np.int64))
    return tuple(zip(counts, places, strict=True))


def _problem(
    place: Place, flow: IntArray, goals: IntArray, discount: float, own: Mapping[str, FloatArray]
) -> tuple[NavigationProblem, dict[str, str]]:
    """What is learned on, whose decisions take time, and why features take no part; flow: (S,)."""
    grid, scenario = place.grid, place.scenario
    distance_m = wall_distance_of(scenario, grid) if scenario else grid_wall_distance_m(grid)
    by_decisions = build_navigation_problem(
        grid=grid, flow=flow, goal_states=goals, wall_distance_m=distance_m, discount=discount
    )
    timed = with_dwell_times(by_decisions, patience_s=place.patience_s, wait_s=place.wait_s)
    return with_chosen_features(timed, own, walls_seen=scenario is not None or place.has_walls)


def _centres_m(grid: Grid, states: IntArray) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in grid.centers_m[states])


def _scenario_of(
    place: Place, problem: NavigationProblem, decisions: Decisions
) -> tuple[str, float]:
    """What is kept beside the model, an own scenario or one of the cells of a fitted grid, and the
    time-out of a drive in it."""
    if place.scenario is not None:
        return own_scenario_yaml(place.scenario), place.scenario.episode_timeout_s
    begins = np.unique(decisions.episode, return_index=True)[1]
    found = grid_scenario(
        problem.grid,
        problem.goal_states,
        decisions.state[begins],
        place.patience_s,
        place.wait_s,
        name="stated area" if place.has_walls else FITTED,
    )
    return (found[0], found[1].episode_timeout_s) if found else ("", LearningTask.timeout_s)


def _flow(table: Path, place: Place, wanted: FlowSource) -> tuple[IntArray, str]:
    """(S,) and where it is from; auto: of the scenario, else recorded, else none."""
    grid, scenario = place.grid, place.scenario
    if wanted == "scenario" and scenario is None:
        raise AppError("--flow scenario needs a scenario, got none; use --flow recorded or none")
    if scenario is not None and wanted in ("auto", "scenario"):
        return flow_of(scenario, grid), "scenario"
    if wanted == "recorded" and not table.exists():
        raise AppError(
            f"--flow recorded needs a flow of recorded people, 'serd demos' wrote no {table}, for"
            f" the bags hold no people; use --flow none{' or scenario' if scenario else ''}"
        )
    if wanted == "recorded" or (wanted == "auto" and table.exists()):
        return load_flow(table, grid), "recorded"
    return np.full(grid.n_states, NO_FLOW, dtype=np.int64), "none"


def usual_goal_states(decisions: Decisions, grid: Grid) -> IntArray:
    """The states in which the episodes end, or of these the neighbouring ones that leave more
    decisions before the goal: on round trips and in crowds, some begin where others end."""
    best = np.unique(list(_ends(decisions).values()))
    most = len(until_goal(decisions, best))
    for group in _neighbouring(best, grid):
        n_left = len(until_goal(ending_in(decisions, group), group))
        if n_left > most:
            best, most = group, n_left
    return best


def ending_in(decisions: _Table, states: IntArray) -> _Table:
    """The decisions of the episodes that end in one of the states."""
    wanted = set(states.tolist())
    return decisions.select_episodes(
        episode for episode, end in _ends(decisions).items() if end in wanted
    )


def _ends(decisions: Decisions) -> dict[int, int]:
    """The last state of each episode."""
    return dict(zip(decisions.episode.tolist(), decisions.next_state.tolist(), strict=True))


def _neighbouring(states: IntArray, grid: Grid) -> list[IntArray]:
    """The states in groups, between which there are three cells or more."""
    picture = np.zeros(grid.walkable.shape, dtype=bool)
    rows, columns = grid.cells[states].T
    picture[rows, columns] = True
    around = np.ones((3, 3))
    labels, count = label(binary_dilation(picture, around), around)
    return [states[labels[rows, columns] == group + 1] for group in range(count)]


def until_goal(decisions: _Table, goal_states: IntArray) -> _Table:
    """The decisions of every episode up to the first that leads into the goal."""
    order = np.argsort(decisions.episode, kind="stable")
    episode = decisions.episode[order]
    over = np.isin(decisions.state[order], goal_states)
    arrives = np.isin(decisions.next_state[order], goal_states)
    over[1:] |= arrives[:-1] & (episode[1:] == episode[:-1])
    first, n_over = np.searchsorted(episode, episode), np.cumsum(over)
    kept = np.empty(len(order), dtype=np.bool_)
    kept[order] = n_over == (n_over - over)[first]
    return decisions.select(kept)


def episodes_reaching(decisions: Decisions, goal_states: IntArray) -> IntArray:
    """(E,) numbers of the episodes that begin elsewhere and come to the goal.

    One that decides in it has come to it, also where its move there is not recorded.
    """
    there = np.isin(decisions.state, goal_states) | np.isin(decisions.next_state, goal_states)
    began_elsewhere = until_goal(decisions, goal_states).episodes
    return np.asarray(began_elsewhere[np.isin(began_elsewhere, decisions.episode[there])])
