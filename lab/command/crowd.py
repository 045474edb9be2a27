"""`python -m lab crowd`: simulated people beside measured ones."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from lab.crowd.comparison import compare_with_recording, compare_with_weidmann
from lab.crowd.corridor_measures import Corridor, CorridorMeasures, corridor_of, measure_recording
from lab.crowd.figure import draw_crowd_comparison
from lab.crowd.meetings import (
    ROBOT,
    head_on,
    meetings_row,
    recorded_moments,
    simulated_moments,
)
from lab.crowd.straight_corridor import corridor_people
from lab.experiments.running.tables import Row, plain_rows, print_results
from serd_app.report.style import save_figure
from serd_bag.files import require_file_place
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, require_suffix
from serd_cli.output.demonstrations import short_names
from serd_cli.output.terminal import print_json, progress_console
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import Track, read_trajectories
from serd_sim.crowd.social_force import model_names
from serd_sim.errors import SimError

#: Densities (people per m²) of the recordings of two-way flow.
MEETING_DENSITIES, MEETING_SEEDS = (0.75, 1.0, 1.25), (1, 2)
_Recording = tuple[str, Corridor, CorridorMeasures]


def crowd(
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            help="people recorded in a straight corridor: a table as `serd demos` reads; repeat"
        ),
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="frames per second of recordings that do not state them")
    ] = None,
    width: Annotated[
        float | None, typer.Option(help="width of the corridor (m), else by where people walked")
    ] = None,
    output: Annotated[Path, typer.Option(help="picture to write, .png")] = Path("crowd.png"),
    as_json: AsJson = False,
) -> None:
    """Compare the crowd models with Weidmann's speeds, and with recordings.

    python -m lab crowd --recording bi_corr_400_b_03.txt --output crowd.png

    Direction and flow of a corridor are found in its recording.
    """
    require_suffix(output, ".png")
    require_file_place(output)
    for name, value in (("--fps", fps), ("--width", width)):
        if value is not None and not value > 0:
            raise UsageError(f"{name} must be above 0, got {value:g}")
    recorded, meetings = list[_Recording](), list[Row]()
    for name, path in _named(dict.fromkeys(recording or ())):
        tracks, corridor, measures = _read(path, fps, width)
        recorded.append((name, corridor, measures))
        if corridor.flow == "two ways":
            meetings.append(meetings_row(name, head_on(recorded_moments(tracks, corridor))))
    with progress_console.status("walking") as status:
        rows = []
        for row in _compared(recorded):
            rows.append(row)
            status.update(f"{row['model']}, {row['place']}, {row['density_pm2']} people per m²")
        meetings += _simulated_meetings()
    table, head_ons = pd.DataFrame(rows), pd.DataFrame(meetings)
    save_figure(output, draw_crowd_comparison(table))
    if as_json:
        found = {"rows": plain_rows(table), "meetings": plain_rows(head_ons)}
        print_json({**found, "picture": str(output.resolve())})
        return
    print_results(table, "Simulated and measured people")
    print_results(head_ons, "Who meets head-on: distance when passing, mean way aside")
    print(f"picture: {output.resolve()}")


def _named(paths: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    """Files with names by which they differ."""
    files = list(paths)
    stems = [path.with_suffix("") for path in files]
    return zip(short_names(stems if len({*stems}) == len(stems) else files), files, strict=True)


def _read(
    path: Path, fps: float | None, width_m: float | None
) -> tuple[Sequence[Track], Corridor, CorridorMeasures]:
    people = read_trajectories(path, TableColumns(fps=fps))
    try:
        walking = corridor_people(people.tracks)
        if len(walking.tracks) < 2:
            raise SimError("people must be at least 2, got 1; give a recording of more people")
        corridor = corridor_of(walking.tracks, width_m)
        measures = measure_recording(walking.tracks, corridor)
    except SimError as error:
        raise SimError(f"{path}: {error}") from None
    for sentence in (*people.assumed, *walking.remarks):
        progress_console.print(f"{path.name}: {sentence}")
    progress_console.print(
        f"{path.name}: {len(walking.tracks)} people, corridor of {corridor.width_m:g} m along "
        f"{'xy'[corridor.axis]}, {corridor.flow}"
    )
    return walking.tracks, corridor, measures


def _simulated_meetings() -> Iterator[Row]:
    for model in model_names():
        for robot in (False, True):
            found = [
                head_on(
                    simulated_moments(model, density_pm2=density, robot=robot, seed=seed),
                    ROBOT if robot else None,
                )
                for seed in MEETING_SEEDS
                for density in MEETING_DENSITIES
            ]
            who = f"{model}, {'a robot' if robot else 'people'}"
            yield meetings_row(who, np.concatenate(found), n_aside=1 if robot else 2)


def _compared(recorded: list[_Recording]) -> Iterator[Row]:
    for model in model_names():
        yield from compare_with_weidmann(model)
        for name, corridor, measures in recorded:
            yield from compare_with_recording(model, name, corridor, measures)
