"""`python -m lab truth`: are headlines true? Recordings of a foreign robot, and worlds."""

import tempfile
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from lab.truth.judge import judge, verdict_of
from lab.truth.recordings import KINDS, write_recording
from lab.truth.worlds import FAMILIES, Claim, claim
from serd_cli.output.terminal import console
from serd_files.table import read_rows, write_rows


def truth(
    name: Annotated[
        list[str] | None, typer.Option(help=f"{', '.join(KINDS)}; default: all; repeat")
    ] = None,
    recording: Annotated[
        Path, typer.Option(help="a real bag besides, without rollouts", envvar="SERD_TRUTH_BAG")
    ] = Path("../shared/data/bags/test-bag"),
    worlds: Annotated[
        int, typer.Option(min=0, help="simulated worlds, ten of which are a set")
    ] = 0,
    output: Annotated[Path, typer.Option(help="table of claims in worlds, resumed")] = Path(
        "claims.csv"
    ),
    seed: Annotated[int, typer.Option(min=0, help="seed of the recordings")] = 0,
    bag: Annotated[Path | None, typer.Option(help="write the recording of --name there")] = None,
) -> None:
    """Learn from each recording as a stranger would, let the robot drive, and compare.

    python -m lab truth
    python -m lab truth --worlds 100 --output claims.csv
    python -m lab truth --name laps --bag laps

    For each recording the headline, its checks and rollouts are printed. Exit code 1 where a
    headline and the rollouts disagree by more than their intervals. With --worlds the headlines
    of simulated worlds are counted instead: wrong ones, and those withheld for nothing.
    """
    if bag is not None:
        console.print(write_recording(KINDS[(name or ["laps"])[0]], bag, seed), soft_wrap=True)
        return
    if worlds:
        _count(worlds, output)
        return
    disagreeing = []
    with tempfile.TemporaryDirectory() as folder:
        for each in name or KINDS:
            verdict = judge(each, Path(folder), seed)
            for line in verdict.lines():
                console.print(line, soft_wrap=True, markup=False)
            disagreeing += [each] * bool(verdict.disagrees)
        if not name and not recording.exists():
            console.print(
                f"{recording} is not there, so no real recording is judged", soft_wrap=True
            )
        elif not name:
            for line in verdict_of("recording", recording, Path(folder), None).lines():
                console.print(line, soft_wrap=True, markup=False)
    if disagreeing:
        console.print(f"headline and rollouts disagree: {', '.join(disagreeing)}", style="red")
        raise typer.Exit(1)


def _count(n_worlds: int, output: Path) -> None:
    rows = list(read_rows(output, Claim)) if output.exists() else []
    names = list(FAMILIES)
    for number in range(len(rows), n_worlds):
        rows.append(claim(names[number % len(names)], number // len(names)))
        write_rows(output, Claim, rows)
    for name in dict.fromkeys(row.family for row in rows):
        _print(name, [row for row in rows if row.family == name])
    _print("all", rows)


def _print(name: str, rows: list[Claim]) -> None:
    counts = Counter((row.claimed, row.right) for row in rows)
    stated, right = counts[1, 0] + counts[1, 1], counts[1, 1] + counts[0, 1]
    console.print(
        f"{name}: {counts[1, 0]} of {stated} headlines wrong;"
        f" {counts[0, 1]} of {right} withheld where the forecast was right"
    )
