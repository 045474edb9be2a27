"""`serd crowd`: compare simulated people with measured ones."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure
from rich.table import Table

from report.figures.crowd_comparison import CrowdCurve, draw_crowd_comparison
from report.style import png_bytes
from serd_cli.options import AsJson
from serd_cli.output.paths import require_file_place, require_suffix
from serd_cli.output.terminal import console, print_json, progress_console
from sim.crowd.comparison import ComparedSpeed, compare_one_way, compare_two_ways
from sim.crowd.corridor_measures import CorridorMeasures, measure_recording
from sim.crowd.ring_corridor import weidmann_speed_mps
from sim.crowd.social_force import model_names
from storage.files import atomic_write_bytes
from storage.trajectories.read import read_trajectories


def register(app: typer.Typer) -> None:
    """Add the subcommands."""
    group = typer.Typer(
        no_args_is_help=True, suggest_commands=True, help="Compare the crowd with measured ones."
    )
    group.callback()(lambda: None)
    group.command()(compare)
    app.add_typer(group, name="crowd")


def compare(
    recording: Annotated[
        Path | None,
        typer.Option(
            help="people recorded in a corridor of 4 m along x: a table as `serd demos` reads"
        ),
    ] = None,
    output: Annotated[Path, typer.Option(help="picture to write, .png")] = Path("crowd.png"),
    as_json: AsJson = False,
) -> None:
    """Compare both crowd models with Weidmann's speeds, and with a recording.

    serd crowd compare --recording bi_corr_400_b_03.txt --output crowd.png
    """
    require_suffix(output, ".png")
    require_file_place(output)
    recorded = None
    if recording is not None:
        people = read_trajectories(recording)
        for sentence in people.assumed:
            progress_console.print(sentence)
        recorded = measure_recording(people.tracks)
    rows = []
    with progress_console.status("walking") as status:
        for row in _compared(recorded):
            rows.append(row)
            status.update(f"{row.model}, {row.flow}, {row.density_pm2:g} people per m²")
    atomic_write_bytes(output, png_bytes(_figure(rows, recording)))
    if as_json:
        values = [
            {key: None if value != value else value for key, value in asdict(row).items()}
            for row in rows
        ]
        print_json({"rows": values, "picture": str(output.resolve())})
        return
    console.print(_table(rows))
    print(f"picture: {output.resolve()}")


def _compared(recorded: CorridorMeasures | None) -> Iterator[ComparedSpeed]:
    for model in model_names():
        yield from compare_one_way(model)
        if recorded is not None:
            yield from compare_two_ways(model, recorded)


def _figure(rows: list[ComparedSpeed], recording: Path | None) -> Figure:
    density = np.linspace(0.15, 2.0, 60)
    weidmann = CrowdCurve(
        "Weidmann 1993", density, weidmann_speed_mps(density), np.full(60, np.nan)
    )
    one_way = [_curve(rows, model, "one way") for model in model_names()]
    two_way = [_curve(rows, model, "two ways") for model in model_names()]
    real = None
    if recording is not None:
        there = [row for row in rows if row.flow == "two ways" and row.model == model_names()[0]]
        real = CrowdCurve(
            "recorded",
            np.array([row.density_pm2 for row in there]),
            np.array([row.expected_speed_mps for row in there]),
            np.array([row.expected_passing_distance_m for row in there]),
        )
    return draw_crowd_comparison(one_way, weidmann, two_way, real)


def _curve(rows: list[ComparedSpeed], model: str, flow: str) -> CrowdCurve:
    mine = [row for row in rows if (row.model, row.flow) == (model, flow)]
    return CrowdCurve(
        model,
        np.array([row.density_pm2 for row in mine]),
        np.array([row.speed_mps for row in mine]),
        np.array([row.passing_distance_m for row in mine]),
    )


def _table(rows: list[ComparedSpeed]) -> Table:
    table = Table(title="Simulated | measured", title_justify="left")
    for name in ("model", "flow", "people per m²", "speed (m/s)", "passing distance (m)"):
        table.add_column(name)
    for row in rows:
        passing = f"{row.passing_distance_m:.2f} | {row.expected_passing_distance_m:.2f}"
        table.add_row(
            row.model,
            row.flow,
            f"{row.density_pm2:g}",
            f"{row.speed_mps:.2f} | {row.expected_speed_mps:.2f}",
            "" if np.isnan(row.passing_distance_m) else passing,
        )
    return table
