"""How usual `serd report` finds robots that keep to a side of a corridor, and robots that do not.

Stand-ins for tracks of tele-operated robots: poses at 10 Hz without commands. Both kinds begin
anywhere across the corridor; the compliant one goes to its right side, the other to its left.
Writes the rows and the picture of docs/compare.md.

python -m lab compliance
"""

import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from lab.benchmarks.recordings.sources import serd
from lab.benchmarks.report import markdown_row, write_rows
from serd_bag.files import atomic_write_text

_DOCUMENT = Path(__file__).absolute().parents[3] / "docs" / "compare.md"
_PICTURE = _DOCUMENT.parent / "pictures" / "compare.png"
_LENGTH_M, _WIDTH_M, _PERIOD_S, _SPEED_MPS = 16.0, 4.0, 0.1, 0.9
#: y of the lane that each kind goes to, and how fast it moves sideways.
_LANES_M, _SIDEWAYS_MPS = {"compliant": 1.0, "not compliant": 3.0}, 0.3


def write_tracks(path: Path, kind: str, n_robots: int, seed: int) -> None:
    """A table of `n_robots` drives from west to east."""
    rng, lines = np.random.default_rng(seed), ["id,time_s,x_m,y_m"]
    for robot in range(n_robots):
        x_m, y_m, time_s = 0.5, float(rng.uniform(0.5, _WIDTH_M - 0.5)), 100.0 * robot
        while x_m < _LENGTH_M - 0.5:
            lines.append(f"{robot},{time_s:.1f},{x_m:.3f},{y_m:.3f}")
            reach_m = _SIDEWAYS_MPS * _PERIOD_S
            y_m += float(np.clip(_LANES_M[kind] - y_m, -reach_m, reach_m) + rng.normal(0.0, 0.02))
            y_m = min(max(y_m, 0.2), _WIDTH_M - 0.2)
            x_m += _SPEED_MPS * _PERIOD_S * (1.0 + float(rng.normal(0.0, 0.05)))
            time_s += _PERIOD_S
    atomic_write_text(path, "\n".join(lines) + "\n")


def run() -> None:
    """Learn from compliant robots, then score others of both kinds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tables = {}
        for seed, (title, kind, n_robots) in enumerate(
            (
                ("learned from", "compliant", 60),
                ("compliant", "compliant", 40),
                ("not compliant", "not compliant", 40),
            )
        ):
            tables[title] = folder / f"tracks{seed}.csv"
            write_tracks(tables[title], kind, n_robots, seed)
        decisions, model = folder / "decisions.csv", folder / "model.yaml"
        cells = ("--cell-size-m", "1", "--period-s", "1")
        serd("demos", tables["learned from"], *cells, "--output", decisions)
        serd("learn", decisions, "--output", model)
        options = ("--output", folder / "page", "--json", "--demonstrations")
        rows = [
            _row(title, json.loads(serd("report", model, *options, table))["familiarity"])
            for title, table in tables.items()
        ]
        shutil.copy(folder / "page" / "figures" / "surprises.png", _PICTURE)
    print("".join(rows), end="")
    write_rows(_DOCUMENT, ["robots", "episodes"], "".join(rows))


def _row(title: str, found: dict[str, Any]) -> str:
    share = 100 * found["n_surprising"] / found["n_decisions"]
    cells = (
        title,
        found["n_episodes"],
        found["n_decisions"],
        *(_number(found[name]) for name in ("log_likelihood", "simulated")),
        f"{found['mean_rank']:.2f}",
        f"{100 * found['n_unusual'] / found['n_episodes']:.0f} %",
        f"{share:.1f} %",
    )
    return markdown_row(cells)


def _number(value: float | None) -> str:
    return "-inf" if value is None else f"{value:.3f}"
