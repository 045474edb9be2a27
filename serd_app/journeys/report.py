"""The page of any learned model, from what lies beside it and what is given: `serd report`."""

import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from serd_app.errors import ReportError
from serd_app.learning.criticism import recorded_times
from serd_app.learning.knowledge import both_dynamics, load_knowledge
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.outcome import fit_of_file, load_trace, outcome_files
from serd_app.navigation.comparison import predicted_law, starts_of
from serd_app.places.kept_scenario import scenario_of_model
from serd_app.report.inputs import Forecast, ReportInputs, RunFacts
from serd_bag.files import require_folder
from serd_files.model_file import ModelFile, load_model, require_grid
from serd_files.table import load_episodes
from serd_sim.drivers.strategy import Strategy, load_strategy
from serd_sim.scenario.grid import goal_cell
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.epochs import decisions_of

if TYPE_CHECKING:
    from serd_app.report.write import Reported

_PACKAGES = ("serd", "numpy", "scipy")


@dataclass(frozen=True)
class ReportSources:
    """What a page is made of.

    scenario: in place of the one that the model keeps or names. demonstrations: table of decisions
    on the grid of the model. episodes: `episodes.csv` of `serd navigate`. starts_m: of forecasts,
    besides the start areas.
    """

    model: Path
    scenario: str = ""
    demonstrations: Path | None = None
    episodes: Path | None = None
    starts_m: Sequence[tuple[float, float]] = ()
    policy: str = "optimal"


def report(sources: ReportSources, output: Path) -> "Reported":
    """Write the page with its tables and figures below `output`.

    SerdError or FileError names a missing or wrong file, or one of another grid.
    """
    require_folder(output)
    inputs = inputs_of_model(sources)
    from serd_app.report.write import write_report

    return write_report(inputs, output)


def inputs_of_model(sources: ReportSources) -> ReportInputs:
    """All that a page shows of a model."""
    model, scenario = sources.model, sources.scenario
    file = load_model(model)
    place = load_scenario(scenario or scenario_of_model(model, file.scenario))
    strategy = load_strategy(str(model), place, sources.policy, file=file)
    problem, files = strategy.problem, outcome_files(model)
    trace = load_trace(files["learning"]) if files["learning"].exists() else np.zeros(0)
    if len(trace) and not np.isclose(trace[-1], file.fit.objective):
        trace = np.zeros(0)  # of another fit
    driven = sources.episodes
    episodes = () if driven is None else load_episodes(driven)
    if driven is not None and not episodes:
        raise ReportError(f"{driven} must have at least one episode, got none; drive some")
    return ReportInputs(
        title=f"Learned model: {file.scenario or 'fitted grid'}",
        strategy=strategy,
        fit=fit_of_file(file, problem, trace),
        episodes=episodes,
        run=_facts(file),
        knowledge=load_knowledge(files, problem.grid) if len(trace) else None,
        both=both_dynamics(files) if len(trace) else (),
        forecasts=tuple(_forecasts(strategy, sources.starts_m)),
        **_recorded(sources, strategy),
        n_demonstrations=file.fit.n_episodes,
    )


def _recorded(sources: ReportSources, strategy: Strategy) -> dict[str, Any]:
    """What demonstrations give: decisions and arrivals."""
    table, file = sources.demonstrations, strategy.file
    if table is None:
        return {"demonstrations": decisions_of({}, "")}
    if table.is_dir():
        raise ReportError(
            f"--demonstrations must be a table of decisions, got the folder {table};"
            " 'serd demos' makes one of a recording"
        )
    scenario = sources.scenario if file.scenario else ""
    files = read_learning_files(
        table, discount=file.discount, scenario=scenario, goals_m=tuple(file.goals_m)
    )
    require_grid(sources.model, file, files.task.problem.grid)
    return {
        "demonstrations": files.decisions.select(~files.decisions.censored),
        "recorded": recorded_times(strategy, files.decisions, files.reaching),
    }


def _forecasts(strategy: Strategy, starts_m: Sequence[tuple[float, float]]) -> Iterator[Forecast]:
    """The arrival from each start area and from the cells of points.

    A fitted grid has one area, where demonstrations began.
    """
    for name in strategy.scenario.start_areas_m:
        start = f"area {name}" if strategy.file.scenario else "where demonstrations began"
        trapped = starts_of(strategy, name).n_trapped > 0
        yield Forecast(start, predicted_law(strategy, name), trapped)
    grid = strategy.problem.grid
    for x_m, y_m in starts_m:
        cell = goal_cell(grid, x_m, y_m, what="start")
        law = strategy.law_from(np.eye(1, grid.n_states, cell)[0])
        yield Forecast(f"{x_m:g}, {y_m:g}", law, cell in strategy.driven.learned_traps)


def _facts(file: ModelFile) -> RunFacts:
    return RunFacts(
        command=shlex.join(["serd", *sys.argv[1:]]),
        how=f"method {file.method}, cells of {file.grid.cell_size_m:g} m, patience of"
        f" {file.patience_s:g} s",
        finished_at=datetime.now().astimezone().isoformat(timespec="seconds"),
        versions={name: version(name) for name in _PACKAGES},
    )
