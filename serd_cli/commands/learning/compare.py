"""`serd compare`: how usual trajectories are for a learned model."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from serd_app.drives.mapped.mapping import BagMapping, TableMapping
from serd_app.drives.table_drives import is_table
from serd_app.learning.learning_files import FlowSource, LearningFiles
from serd_app.navigation.evaluation.familiarity import Familiarity, familiarity_of
from serd_bag.quantities import counted
from serd_cli.options import AsJson
from serd_cli.output.paths import require_apart, require_suffix
from serd_cli.output.terminal import console, finite, print_json
from serd_files.table import write_rows
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.goal import point_of

#: Episodes listed on the terminal, those of the lowest ranks.
_LISTED = 10
#: Rank below which an episode is unusual.
_UNUSUAL = 0.05


@dataclass(frozen=True)
class EpisodeRow:
    """An episode of the table; log_likelihood, simulated: means per decision, rank: 0 to 1.

    log_likelihood: None where the model rules out a decision.
    """

    episode: int
    decisions: int
    log_likelihood: float | None
    simulated: float | None
    rank: float
    surprising: int


def compare(
    model: Annotated[Path, typer.Argument(help="file of a learned model")],
    trajectories: Annotated[
        list[Path], typer.Argument(help="table of decisions, or bags or tables of trajectories")
    ],
    output: Annotated[Path, typer.Option(help="table to write, ending in .csv")] = Path(
        "compared.csv"
    ),
    mapping: Annotated[
        Path | None, typer.Option(help="YAML file as for 'serd demos', not for decisions")
    ] = None,
    scenario: Annotated[
        str, typer.Option(help="scenario or YAML file, in place of the one the files name")
    ] = "",
    flow: Annotated[FlowSource, typer.Option(help="way people walk, as in 'serd learn'")] = "auto",
    goal: Annotated[
        list[str] | None, typer.Option(help="x,y (m) of a goal cell, repeat; default: the model's")
    ] = None,
    simulations: Annotated[int, typer.Option(help="simulated episodes for each one", min=1)] = 200,
    surprise: Annotated[
        float, typer.Option(help="mark decisions of a lower tail probability", min=0, max=1)
    ] = 0.01,
    seed: Annotated[int, typer.Option(help="seed of the simulated episodes", min=0)] = 0,
    as_json: AsJson = False,
) -> None:
    """Score trajectories by a learned model, and mark surprising decisions.

    serd compare model.yaml others.csv

    The table has a row per episode that begins before the goal: its mean
    log-likelihood per decision, that of episodes simulated from the model, and
    its rank among these, from 0 (less likely than all) to 1. Beside it is a
    picture: decisions are surprising where all that is as likely or less in
    their cell has a probability below --surprise together.
    """
    require_suffix(output, ".csv")
    picture = output.with_suffix(".png")
    require_apart(output, (picture,), (model, *trajectories, mapping or "", scenario))
    chosen = None
    if mapping is not None:
        kind = TableMapping if all(map(is_table, trajectories)) else BagMapping
        chosen = load_yaml_model(mapping, kind)
    found = familiarity_of(
        model,
        trajectories,
        mapping=chosen,
        scenario=scenario,
        flow=flow,
        goals_m=tuple(point_of(each) for each in goal or ()),
        n_simulated=simulations,
        seed=seed,
    )
    from serd_app.report.figures.map_axes import layout_of
    from serd_app.report.figures.maps import draw_surprises
    from serd_app.report.style import save_figure

    layout = layout_of(found.files.scenario) if found.files.scenario else None
    rows = _rows(found, surprise)
    write_rows(output, EpisodeRow, rows)
    figure = draw_surprises(found.problem.grid, found.decisions, found.surprising(surprise), layout)
    save_figure(picture, figure)
    values = _values(found, rows, {"table": output, "picture": picture})
    if as_json:
        print_json({**values, "episodes": [asdict(each) for each in rows]})
        return
    _print(rows, values, found.files)


def _rows(found: Familiarity, level: float) -> list[EpisodeRow]:
    scores, surprising = found.scores, found.surprising(level)
    counts = (np.sum(surprising[found.decisions.episode == n]) for n in scores.episode)
    columns = (
        scores.episode.tolist(),
        scores.n_decisions.tolist(),
        map(finite, scores.log_likelihood.tolist()),
        map(finite, scores.expected.tolist()),
        scores.rank.tolist(),
        map(int, counts),
    )
    return [EpisodeRow(*row) for row in zip(*columns, strict=True)]


def _values(found: Familiarity, rows: list[EpisodeRow], files: dict[str, Path]) -> dict[str, Any]:
    """Over all episodes; the log-likelihood per decision is None where one is ruled out."""
    scores = found.scores
    weights = scores.n_decisions / scores.n_decisions.sum()
    return {
        "n_episodes": len(rows),
        "n_decisions": len(found.decisions),
        "n_after_goal": found.files.n_after_goal,
        "n_elsewhere": found.files.n_elsewhere,
        "n_episodes_left_out": found.files.n_left_out,
        "n_hidden": int(found.decisions.hidden.sum()),
        "log_likelihood": finite(float(weights @ scores.log_likelihood)),
        "simulated": finite(float(weights @ scores.expected)),
        "mean_rank": float(scores.rank.mean()),
        "n_unusual": int(np.sum(scores.rank < _UNUSUAL)),
        "discretised": found.discretised,
        "n_surprising": sum(each.surprising for each in rows),
        "files": {name: path.resolve() for name, path in files.items()},
    }


def _print(rows: list[EpisodeRow], values: dict[str, Any], files: LearningFiles) -> None:
    table = Table(title="Episodes of the lowest ranks", title_justify="left")
    names = ("episode", "decisions", "log-likelihood", "simulated", "rank", "surprising")
    for name in names:
        table.add_column(name, justify="right")
    for each in sorted(rows, key=lambda row: row.rank)[:_LISTED]:
        table.add_row(
            str(each.episode),
            str(each.decisions),
            _number(each.log_likelihood),
            _number(each.simulated),
            f"{each.rank:.3f}",
            str(each.surprising),
        )
    console.print(table)
    console.print(
        f"{counted(values['n_episodes'], 'episode')}, {counted(values['n_decisions'], 'decision')}"
        f" ({values['n_hidden']} without action): log-likelihood per decision"
        f" {_number(values['log_likelihood'])}, of simulated episodes"
        f" {_number(values['simulated'])}; mean rank {values['mean_rank']:.2f}, below"
        f" {_UNUSUAL:g}: {values['n_unusual']}; surprising decisions: {values['n_surprising']}",
        soft_wrap=True,
    )
    if files.left_out():
        console.print(f"decisions left out: {files.left_out()}", soft_wrap=True)
    if files.n_left_out:
        elsewhere = " or end elsewhere" if files.n_elsewhere else ""
        console.print(
            f"episodes left out: {files.n_left_out} that begin in the goal{elsewhere}",
            soft_wrap=True,
        )
    if values["discretised"]:
        console.print(f"on the grid of the model: {values['discretised']}", soft_wrap=True)
    for name, path in values["files"].items():
        console.print(f"{name}: {path}", soft_wrap=True)


def _number(value: float | None) -> str:
    return "-inf" if value is None else f"{value:.3f}"
