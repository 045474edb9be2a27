"""The report of any model file, from what lies beside it and what is given."""

import shlex
import sys
from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from serd_app.demonstrations.recorded import files_beside, report_of_table
from serd_app.drives.mapped.mapping import DriveMapping
from serd_app.errors import ReportError
from serd_app.learning.knowledge import load_knowledge
from serd_app.learning.outcome import fit_of_file, load_trace, outcome_files
from serd_app.navigation.evaluation.comparison import predicted_law
from serd_app.navigation.evaluation.familiarity import familiarity_of
from serd_app.navigation.evaluation.prediction_support import recorded_times, starts_of
from serd_app.navigation.forecast import plan_remarks
from serd_app.places.kept_scenario import scenario_of_model
from serd_app.report.inputs import Forecast, ReportInputs, RunFacts
from serd_core.arrays import FloatArray
from serd_core.semi_markov.timed_decisions import TimedDecisions
from serd_files.episode_table import EpisodeResult, load_episodes
from serd_files.model_file import ModelFile, load_model
from serd_sim.drivers.strategy import Strategy, load_strategy
from serd_sim.scenario.goal import goal_cell
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.epochs import decisions_of

_PACKAGES = ("serd", "numpy", "scipy")


def inputs_of_model(
    model: Path,
    *,
    scenario: str = "",
    demonstrations: Sequence[Path] = (),
    mapping: DriveMapping | None = None,
    episodes: Path | None = None,
    starts_m: Sequence[tuple[float, float]] = (),
    kind: str = "optimal",
) -> ReportInputs:
    """All that a report shows of a model; SerdError names a missing file, or one of another grid.

    scenario: in place of the one that the model keeps or names. demonstrations: table of decisions,
    or bags or tables of trajectories. episodes: `episodes.csv` of `serd navigate`. starts_m: of the
    forecasts, besides the start areas.
    """
    file = load_model(model)
    place = load_scenario(scenario or scenario_of_model(model, file.scenario))
    strategy = load_strategy(str(model), place, kind, file=file)
    areas = {name: predicted_law(strategy, name) for name in place.start_areas_m}
    problem, files = strategy.problem, outcome_files(model)
    trace = _trace(files["learning"], file)
    found = table = None
    if demonstrations:
        own = scenario if file.scenario else ""
        found = familiarity_of(model, demonstrations, mapping=mapping, scenario=own)
        table = demonstrations[0] if files_beside(demonstrations[0])["record"].exists() else None
    return ReportInputs(
        title=f"Learned model: {file.scenario or 'fitted grid'}",
        scenario=place,
        problem=problem,
        demonstrations=_no_decisions() if found is None else found.decisions,
        demonstration_tracks_m=(),
        fit=fit_of_file(file, problem, trace),
        policy=strategy.policy,
        episodes=_episodes(episodes),
        predicted=areas["train"],
        timeout_s=strategy.timeout_s,
        snapshot=None,
        run=_facts(file),
        knowledge=load_knowledge(files, problem.grid) if len(trace) else None,
        forecasts=tuple(
            Forecast(_start(name, file), law, starts_of(strategy, name).n_trapped > 0)
            for name, law in areas.items()
        )
        + forecasts_of(strategy, starts_m),
        familiarity=found,
        discretised=None if table is None else report_of_table(table),
        n_demonstrations=file.fit.n_episodes,
        driven=strategy.driven,
        remarks=tuple(plan_remarks(strategy)),
        recorded=None
        if found is None
        else recorded_times(strategy, found.files.demonstrations.decisions, found.files.reaching),
    )


def _start(name: str, file: ModelFile) -> str:
    """A start area; a fitted grid has one, where demonstrations began."""
    return f"area {name}" if file.scenario else "where demonstrations began"


def forecasts_of(
    strategy: Strategy, starts_m: Sequence[tuple[float, float]]
) -> tuple[Forecast, ...]:
    """The arrival from the cells of points."""
    grid, found = strategy.problem.grid, []
    for x_m, y_m in starts_m:
        start, cell = np.zeros(grid.n_states), goal_cell(grid, x_m, y_m, what="start")
        start[cell] = 1.0
        trapped = cell in strategy.driven.learned_traps
        found.append(Forecast(f"{x_m:g}, {y_m:g}", strategy.law_from(start), trapped))
    return tuple(found)


def _episodes(path: Path | None) -> tuple[EpisodeResult, ...]:
    if path is None:
        return ()
    rows = load_episodes(path)
    if not rows:
        raise ReportError(f"{path} must have at least one episode, got none; drive some")
    return rows


def _trace(path: Path, file: ModelFile) -> FloatArray:
    """The steps of the fit, none where the file beside the model is of another fit."""
    trace = load_trace(path) if path.exists() else np.zeros(0)
    return trace if len(trace) and np.isclose(trace[-1], file.fit.objective) else np.zeros(0)


def _no_decisions() -> TimedDecisions:
    return decisions_of({}, "")


def _facts(file: ModelFile) -> RunFacts:
    return RunFacts(
        command=shlex.join(["serd", *sys.argv[1:]]),
        how=f"method {file.method}, cells of {file.grid.cell_size_m:g} m, patience of"
        f" {file.patience_s:g} s",
        finished_at=datetime.now().astimezone().isoformat(timespec="seconds"),
        versions={name: version(name) for name in _PACKAGES},
    )
