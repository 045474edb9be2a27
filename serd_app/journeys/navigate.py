"""A learned model drives, and its predicted arrival is held against it: `serd navigate`.

The folder of a drive belongs to the settings and the files that it was begun with.
"""

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from serd_app.errors import AppError
from serd_app.navigation.comparison import Comparison, arrival_times_s, compare, predicted_law
from serd_app.navigation.navigator import ArrivalRecords, Navigator, planned_navigator
from serd_app.navigation.settings import DriveSettings
from serd_bag.files import read_text, require_folder
from serd_core.grid.grid import Action
from serd_files.errors import missing_pictures
from serd_files.table import EpisodeResult, load_episodes, write_rows
from serd_files.yaml_config import load_yaml_model, save_yaml_model
from serd_sim.episodes.episode import result_of_record, run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import start_states_of
from serd_sim.scenario.scenario import scenario_digest
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.world import HallwayWorld

#: Drives a series of episodes by a planned model and returns their rows; the folder is that of
#: tables, if any.
Drive = Callable[[DriveSettings, Path | None, Navigator], Sequence[EpisodeResult]]


@dataclass(frozen=True, eq=False)
class Navigated:
    """A series of episodes beside its prediction.

    patience_remark: of the scenario, empty for none. missing: why no picture was drawn, empty where
    one was or none was wanted.
    """

    settings: DriveSettings
    comparison: Comparison
    patience_remark: str
    missing: str = ""


def navigate(settings: DriveSettings, output: Path | None, drive_all: Drive) -> Navigated:
    """Plan, drive and compare; output: folder of tables and arrival.png, None to keep nothing.

    drive_all: as `drive`, in this process or by nodes. SerdError or FileError for an option that
    does not fit the model or the place, before anything drives, and for a folder of another drive.
    """
    navigator = planned_navigator(settings)
    strategy = navigator.strategy
    start_states_of(strategy.scenario, strategy.problem.grid, settings.start_area)
    make_planner(strategy.scenario)
    if output is not None:
        require_folder(output)
        claim_folder(output, settings)
    rows = drive_all(settings, output, navigator)
    missing = "" if output is None else missing_pictures()
    if output is not None and not missing:
        from serd_app.report.charts import draw_comparison
        from serd_app.report.style import save_figure

        law, times_s = predicted_law(strategy, settings.start_area), arrival_times_s(rows)
        figure = draw_comparison(law, times_s, strategy.timeout_s)
        save_figure(output / "arrival.png", figure)
    comparison = compare(strategy, settings.start_area, rows)
    return Navigated(settings, comparison, strategy.scenario.patience_remark, missing)


class BegunDrive(DriveSettings):
    """The settings of the drive, and digests of the content of its two files."""

    model_digest: str
    scenario_digest: str


def claim_folder(folder: Path, settings: DriveSettings) -> None:
    """Take a new folder, or one that was begun with the same settings; AppError otherwise."""
    file = folder / "navigate.yaml"
    now = BegunDrive(
        **settings.model_dump(),
        model_digest=hashlib.sha256(read_text(settings.model).encode()).hexdigest()[:12],
        scenario_digest=scenario_digest(settings.place()),
    )
    if file.is_file():
        _require_same(folder, load_yaml_model(file, BegunDrive), now)
        return
    if folder.exists() and any(folder.iterdir()):
        raise AppError(f"{folder} must be new, empty or an earlier run's; give another folder")
    save_yaml_model(file, now)


def _require_same(folder: Path, earlier: BegunDrive, now: BegunDrive) -> None:
    for name in DriveSettings.model_fields:
        if name != "episodes" and getattr(earlier, name) != getattr(now, name):
            raise AppError(
                f"{folder} was begun with {name} = {getattr(earlier, name)!r}, but "
                f"{getattr(now, name)!r} is given; give another folder or the same settings"
            )
    for name, recorded, found in (
        (now.model, earlier.model_digest, now.model_digest),
        (now.scenario, earlier.scenario_digest, now.scenario_digest),
    ):
        if recorded != found:
            raise AppError(
                f"{folder} must hold drives of {name} as it is now ({found}), but was begun with "
                f"{recorded} of it; give another folder"
            )


def finished_episodes(settings: DriveSettings, output: Path | None) -> list[EpisodeResult]:
    """The episodes of an interrupted drive; none without its table."""
    table = None if output is None else output / "episodes.csv"
    if table is None or not table.is_file():
        return []
    return list(load_episodes(table)[: settings.episodes])


def drive(
    settings: DriveSettings,
    output: Path | None,
    on_episode: Callable[[EpisodeResult], None],
    navigator: Navigator | None = None,
) -> list[EpisodeResult]:
    """Drive the episodes that are not finished yet; the rows of all of them.

    output: folder that gets each row as it comes, none when None. navigator: planned by these
    settings, None to plan here.
    """
    navigator = navigator or planned_navigator(settings)
    records, results = ArrivalRecords(output), finished_episodes(settings, output)

    def observe(observation: Observation, _: Command, __: Action) -> bool:
        records.note_decision(navigator, observation)
        return not navigator.reason

    with HallwayWorld(navigator.strategy.scenario, seed=settings.seed) as world:
        planner = make_planner(navigator.strategy.scenario)
        for episode in range(len(results), settings.episodes):
            began_s = time.monotonic()
            record = run_episode(
                world,
                planner,
                navigator,
                episode=episode,
                start_area=settings.start_area,
                timeout_s=settings.timeout_s,
                observer=observe,
            )
            wall_s = time.monotonic() - began_s
            results.append(result_of_record(record, reason=navigator.reason, wall_s=wall_s))
            records.note_result(results[-1])
            if output is not None:
                write_rows(output / "episodes.csv", EpisodeResult, results)
            on_episode(results[-1])
    return results
