"""Learning from files: a table of decisions and what `serd demos` wrote beside it."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.ndimage import binary_dilation, label

from serd_app.demonstrations.decision_table import load_decisions
from serd_app.demonstrations.flow_field import load_flow
from serd_app.demonstrations.recorded import DemonstrationRecord, files_beside
from serd_app.errors import AppError
from serd_app.learning.recipe import LearningTask
from serd_app.learning.settings import FlowSource
from serd_app.places.kept_scenario import own_scenario_yaml, scenario_beside
from serd_app.places.map_scenario import grid_scenario
from serd_bag.errors import FileError
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.grid.grid import Grid, grid_wall_distance_m
from serd_core.grid.navigation import (
    NO_FLOW,
    NavigationProblem,
    build_navigation_problem,
    with_dwell_times,
)
from serd_files.grid_file import load_grid
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.grid import flow_of, goal_states_of, grid_of, wall_distance_of
from serd_sim.scenario.scenario import Scenario, load_scenario

_Table = TypeVar("_Table", bound=Decisions)


@dataclass(frozen=True, eq=False)
class LearningFiles:
    """task: where it was; flow_from: scenario, recorded or none; n_after_goal: decisions left out;
    n_elsewhere: those of episodes that end in other places than the goal, also left out;
    elsewhere_m: centres of these places.
    goals_m: centres (x, y) of the goal cells; reaching: (E,) episodes that come to one. scenario:
    None where the grid was fitted.
    """

    task: LearningTask
    decisions: TimedDecisions
    flow_from: str
    goals_m: tuple[tuple[float, float], ...]
    n_after_goal: int
    n_elsewhere: int
    elsewhere_m: tuple[tuple[float, float], ...]
    reaching: IntArray
    scenario: Scenario | None = None

    def left_out(self) -> str:
        """How many decisions, and why; empty where there are none."""
        reasons = (
            (self.n_after_goal, "after the goal"),
            (self.n_elsewhere, "of episodes that end elsewhere"),
        )
        return ", ".join(f"{count} {why}" for count, why in reasons if count)

    def remarks(self) -> Iterable[str]:
        """A warning where no episode reaches the goal."""
        if not len(self.reaching):
            goals = "; ".join(f"{x:g},{y:g}" for x, y in self.goals_m)
            yield (
                f"no episode reaches the goal ({goals}), so no arrival shows what it is worth;"
                " name the goal people went to with --goal, or record episodes that arrive"
            )


def read_learning_files(
    table: Path,
    *,
    discount: float,
    scenario: str = "",
    flow: FlowSource = "auto",
    goals_m: tuple[tuple[float, float], ...] = (),
) -> LearningFiles:
    """Everything learning needs; FileError and AppError where the files contradict each other.

    scenario: in place of the one the record names. goals_m: places of the goal, by default the
    scenario's goal area, or without a scenario where most of the episodes end.
    """
    files = files_beside(table)
    all_decisions, grid, record, known = _read(files, scenario)
    goals, decisions = _goals(all_decisions, grid, known, goals_m)
    elsewhere = all_decisions.select(~np.isin(all_decisions.episode, decisions.episode))
    others = usual_goal_states(elsewhere, grid) if len(elsewhere) else goals[:0]
    kept = until_goal(decisions, goals)
    chosen, source = _flow(files["flow"], grid, known, flow)
    problem = _problem(grid, known, record, chosen, goals, discount)
    return LearningFiles(
        task=LearningTask(
            problem,
            known.name if known else "",
            own_flow=source != "scenario",
            scenario_yaml=_scenario_yaml(known, problem, kept, record),
        ),
        decisions=kept,
        flow_from=source,
        goals_m=_centres_m(grid, goals),
        n_after_goal=len(decisions) - len(kept),
        n_elsewhere=len(elsewhere),
        elsewhere_m=_centres_m(grid, others),
        reaching=episodes_reaching(decisions, goals),
        scenario=known,
    )


def _read(
    files: dict[str, Path], scenario: str
) -> tuple[TimedDecisions, Grid, DemonstrationRecord, Scenario | None]:
    """The decisions and the files beside them, which must be of one place."""
    table = files["decisions"]
    decisions = load_decisions(table)
    for path in (files["grid"], files["record"]):
        if not path.exists():
            raise FileError(
                f"{table}: {path.name}, which is written with it, must be beside it; move it there,"
                " or make both again"
            )
    grid = load_grid(files["grid"])
    record = load_yaml_model(files["record"], DemonstrationRecord)
    place = scenario or scenario_beside(table, record.scenario)
    known = load_scenario(place) if place else None
    _require_one_place(files, record, grid, known)
    _require_states(table, decisions, grid)
    return decisions, grid, record, known


def _goals(
    decisions: TimedDecisions,
    grid: Grid,
    scenario: Scenario | None,
    goals_m: tuple[tuple[float, float], ...],
) -> tuple[IntArray, TimedDecisions]:
    """(G,) states of given places, else of the scenario, else where most episodes end, and the
    decisions of the episodes that end there."""
    if goals_m:
        states = grid.states_at(np.array(goals_m))
        if (states < 0).any():
            x_m, y_m = goals_m[int(np.argmax(states < 0))]
            raise AppError(f"--goal must lie in a walkable cell of the grid, got {x_m:g},{y_m:g}")
        return np.unique(states), decisions
    if scenario:
        return goal_states_of(scenario, grid), decisions
    goals = usual_goal_states(decisions, grid)
    return goals, ending_in(decisions, goals)


def _problem(
    grid: Grid,
    scenario: Scenario | None,
    record: DemonstrationRecord,
    flow: IntArray,
    goals: IntArray,
    discount: float,
) -> NavigationProblem:
    """What is learned on, whose decisions take time; flow: (S,)."""
    distance_m = wall_distance_of(scenario, grid) if scenario else grid_wall_distance_m(grid)
    by_decisions = build_navigation_problem(
        grid=grid, flow=flow, goal_states=goals, wall_distance_m=distance_m, discount=discount
    )
    return with_dwell_times(by_decisions, patience_s=record.patience_s, wait_s=record.wait_s)


def _centres_m(grid: Grid, states: IntArray) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in grid.centers_m[states])


def _scenario_yaml(
    scenario: Scenario | None,
    problem: NavigationProblem,
    decisions: Decisions,
    record: DemonstrationRecord,
) -> str:
    """What is kept beside the model: an own scenario, or one of the cells of a fitted grid."""
    if scenario is not None:
        return own_scenario_yaml(scenario)
    begins = np.unique(decisions.episode, return_index=True)[1]
    found = grid_scenario(
        problem.grid,
        problem.goal_states,
        decisions.state[begins],
        record.patience_s,
        record.wait_s,
        name="fitted grid",
    )
    return found[0] if found else ""


def _require_one_place(
    files: dict[str, Path], record: DemonstrationRecord, grid: Grid, scenario: Scenario | None
) -> None:
    if record.grid_fingerprint != grid.fingerprint():
        raise FileError(
            f"{files['grid']} must be the grid of {files['record']}, but it is another;"
            " run 'serd demos' again"
        )
    if scenario is not None and grid_of(scenario).fingerprint() != grid.fingerprint():
        raise FileError(
            f"{files['grid']} must be the grid of the scenario {scenario.name!r}, but it is"
            " another; run 'serd demos' with this scenario"
        )
    for name in ("patience_s", "wait_s"):
        recorded = getattr(record, name)
        if scenario is not None and getattr(scenario, name) != recorded:
            raise FileError(
                f"{files['record']}: {name} must be {getattr(scenario, name):g} as in the scenario,"
                f" got {recorded:g}; run 'serd demos' again"
            )


def _require_states(table: Path, decisions: Decisions, grid: Grid) -> None:
    if not len(decisions):
        raise FileError(f"{table} must have at least one decision, got none; record more")
    highest = int(max(decisions.state.max(), decisions.next_state.max()))
    if highest >= grid.n_states:
        raise FileError(
            f"{table}: states must be below {grid.n_states}, the number of cells of the grid"
            f" beside it, got {highest}; run 'serd demos' again"
        )


def _flow(
    table: Path, grid: Grid, scenario: Scenario | None, wanted: FlowSource
) -> tuple[IntArray, str]:
    """(S,) and where it is from; auto: of the scenario, else recorded, else none."""
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
    kept = np.ones(len(decisions), dtype=bool)
    for episode in decisions.episodes:
        rows = np.flatnonzero(decisions.episode == episode)
        over = np.isin(decisions.state[rows], goal_states)
        over[1:] |= np.isin(decisions.next_state[rows[:-1]], goal_states)
        kept[rows] = ~np.maximum.accumulate(over)
    return decisions.select(kept)


def episodes_reaching(decisions: Decisions, goal_states: IntArray) -> IntArray:
    """(E,) numbers of the episodes that begin elsewhere and come to the goal.

    One that decides in it has come to it, also where its move there is not recorded.
    """
    there = np.isin(decisions.state, goal_states) | np.isin(decisions.next_state, goal_states)
    began_elsewhere = until_goal(decisions, goal_states).episodes
    return np.asarray(began_elsewhere[np.isin(began_elsewhere, decisions.episode[there])])
