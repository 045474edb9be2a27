"""Commands of the studies: the hallway (chapter 5), four robots and people, resumable."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import pandas as pd
import typer
from pydantic import BaseModel
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from lab import RESULTS
from lab.experiments.running.provenance import recorded
from lab.experiments.running.tables import print_results
from lab.experiments.study.hallway.run import run_study
from lab.experiments.study.hallway.tables import headline
from lab.experiments.study.people.generated import write_corridor
from lab.experiments.study.people.run import run_people
from lab.experiments.study.people.settings import people_settings
from lab.experiments.study.people.tables import headline as people_headline
from lab.experiments.study.products import OnWork
from lab.experiments.study.robots.run import run_robots
from lab.experiments.study.robots.settings import robots_settings
from lab.experiments.study.settings import study_settings
from serd_bag.files import require_folder
from serd_cli.options import EXECUTION, Jobs
from serd_cli.output.terminal import WorkProgress, results_kept_in
from serd_files.trajectories.columns import TableColumns
from serd_files.yaml_config import load_yaml_model
from serd_sim.episodes.execution import Execution

Quick = Annotated[bool, typer.Option("--quick", help="small numbers that still run every stage")]
Settings = TypeVar("Settings", bound=BaseModel)
Tables = Mapping[str, pd.DataFrame]


def _output_of(study: str) -> Any:
    return typer.Option(help=f"folder of the study; default lab/results/{study} (or {study}_quick)")


def _config_of(study: str) -> Any:
    return typer.Option(help=f"YAML file with any part of {study}_study.yaml")


def hallway(
    output: Annotated[Path | None, _output_of("hallway")] = None,
    quick: Quick = False,
    config: Annotated[Path | None, _config_of("hallway")] = None,
    jobs: Jobs = EXECUTION.n_jobs,
) -> None:
    """Navigation in a populated hallway: who learns what, and what arrives when (chapter 5).

    python -m lab hallway --quick

    Finished parts are not repeated: rerun an interrupted command to resume it.
    """
    folder = _folder("hallway", output, quick=quick)
    settings = study_settings(quick=quick, config=config)
    command = _command("hallway", (), folder, quick=quick, config=config)
    tables = _run(run_study, settings, folder, Execution(jobs), command)
    title = f"Learned from {settings.learning.sizes[-1]} demonstrations"
    _show(headline(tables), title, folder)


def robots(
    output: Annotated[Path | None, _output_of("robots")] = None,
    quick: Quick = False,
    config: Annotated[Path | None, _config_of("robots")] = None,
    jobs: Jobs = EXECUTION.n_jobs,
) -> None:
    """Four robots on the same seeds, in two tasks: one needs the detour, one the short way.

    python -m lab robots --quick

    Finished parts are not repeated: rerun an interrupted command to resume it.
    """
    folder = _folder("robots", output, quick=quick)
    settings = robots_settings(quick=quick, config=config)
    command = _command("robots", (), folder, quick=quick, config=config)
    tables = _run(run_robots, settings, folder, Execution(jobs), command)
    _show(tables["summary"], "Seconds to the goal on the same seeds", folder)


def people(
    files: Annotated[
        list[Path], typer.Argument(help="tables of trajectories in a corridor, one per recording")
    ],
    output: Annotated[Path | None, _output_of("people")] = None,
    quick: Quick = False,
    config: Annotated[Path | None, _config_of("people")] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="YAML file with columns, fps and unit of the tables")
    ] = None,
    area: Annotated[
        Path | None, typer.Option(help="WKT or GeoJSON of the corridor; default: where people were")
    ] = None,
    generate: Annotated[
        bool, typer.Option("--generate", help="write the tables first, by their names")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="of --generate")] = 1,
    jobs: Jobs = EXECUTION.n_jobs,
) -> None:
    """Pedestrians of measured corridors as experts: their next moves and times of arrival.

    python -m lab people bi_corr_400_b_03.txt --quick
    python -m lab people narrow.csv --generate     # narrow, wide or askew: of the simulated crowd

    Finished parts are not repeated: rerun an interrupted command to resume it.
    """
    for each in files if generate else ():
        write_corridor(each.stem, each.parent, seed=seed)
    folder = _folder("people", output, quick=quick)
    columns = load_yaml_model(mapping, TableColumns) if mapping is not None else None
    settings = people_settings(files, mapping=columns, area=area, quick=quick, config=config)
    given = {"--mapping": mapping, "--area": area}
    own = [*map(str, files), *(w for k, v in given.items() if v is not None for w in (k, str(v)))]
    command = _command("people", own, folder, quick=quick, config=config)
    tables = _run(run_people, settings, folder, Execution(jobs), command)
    _show(people_headline(tables), "People held out", folder)


def _folder(study: str, output: Path | None, *, quick: bool) -> Path:
    folder = output or RESULTS / (f"{study}_quick" if quick else study)
    require_folder(folder)
    return folder


def _show(shown: pd.DataFrame, title: str, folder: Path) -> None:
    print_results(shown, title)
    print(f"results: {folder.resolve()}")


def _run(
    study: Callable[[Settings, Path, Execution, OnWork], Tables],
    settings: Settings,
    folder: Path,
    execution: Execution,
    command: str,
) -> Tables:
    """Run what is missing of a study, with its progress; command: is recorded."""
    bar = WorkProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with recorded(folder, command, settings), results_kept_in(folder), bar:
        task = bar.add_task("", total=None)
        return study(
            settings,
            folder,
            execution,
            lambda done, total, stage: bar.update(
                task, completed=done, total=total or 1.0, description=stage
            ),
        )


def _command(
    study: str, own: Sequence[str], folder: Path, *, quick: bool, config: Path | None
) -> str:
    """The command that makes the same results; own: words that other studies do not have."""
    words = ["python", "-m", "lab", study, *own, *(["--quick"] if quick else [])]
    words += ["--config", str(config)] if config is not None else []
    return shlex.join([*words, "--output", str(folder)])
