"""Mutated files and arguments load or are refused in one line, in bounded time and memory."""

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.experiments.study.settings import YAML, study_settings
from serd_app.demonstrations.decision_table import (
    DemonstrationRecord,
    FlowField,
    load_decisions,
    load_flow,
    save_decisions,
    save_flow,
)
from serd_app.drives.mapping import BagMapping
from serd_app.journeys.navigate import BegunDrive
from serd_app.learning.checkpoint import LearnerCheckpoint
from serd_app.navigation.navigator import ArrivalRow
from serd_app.places.free_area import read_area_m
from serd_app.places.ros_map import MapFile
from serd_app.teleop.joy_mapping import load_joy_mapping
from serd_app.teleop.twist_mux import load_mux
from serd_cli.output.demo_folder import DemoSettings
from serd_cli.processes.workspace import parse_assignment, stack_processes
from serd_core.demonstrations.decisions import TimedDecisions
from serd_files.grid_file import load_grid, save_grid
from serd_files.model_file import load_model
from serd_files.table import (
    EpisodeResult,
    RowTable,
    load_episodes,
    read_rows,
    write_rows,
    write_table,
)
from serd_files.trajectories.read import read_trajectories
from serd_files.yaml_config import StrictModel, load_yaml_model, save_yaml_model
from serd_ros.graph.graph import find_stack
from serd_sim.episodes.batch import COLUMNS, TASK_COLUMNS
from serd_sim.scenario.grid import flow_of, grid_of
from serd_sim.scenario.scenario import load_scenario
from support.fuzzing import (
    CSV_PIECES,
    FUZZ,
    YAML_PIECES,
    assert_loads_or_one_line,
    mutated_bytes,
    mutated_text,
    mutated_yaml,
)

_ROOT = Path(__file__).resolve().parents[2]
_CORRIDOR = load_scenario("corridor")
_GRID = grid_of(_CORRIDOR)
_PLACE = {"scenario": "corridor", "grid_fingerprint": "0", "patience_s": 4.0, "wait_s": 1.0}
_MODELS: dict[str, StrictModel] = {
    "scenario": _CORRIDOR,
    "mapping": BagMapping(longest_gap_s=1.0),
    "map": MapFile(image="map.pgm", resolution=0.05, origin=(0.0, 0.0, 0.0)),
    "checkpoint": LearnerCheckpoint(**_PLACE, reward_weights={"goal": 1.0}),
    "demonstrations": DemonstrationRecord(**_PLACE),
    "begun_drive": BegunDrive(model="model.yaml", model_digest="0", scenario_digest="0"),
    "demo": DemoSettings(),
}
_TEXTS: dict[str, tuple[Path, Callable[[Path], object]]] = {
    "mux": (_ROOT / "serd_app" / "teleop" / "mux.yaml", load_mux),
    "joy": (_ROOT / "serd_app" / "teleop" / "joy.yaml", load_joy_mapping),
    "study": (YAML, lambda path: study_settings(config=path)),
}
_RINGS = [[[0, 0], [8, 0], [8, 4], [0, 4], [0, 0]], [[2, 1], [3, 1], [3, 2], [2, 2], [2, 1]]]
_AREAS = {
    "area.wkt": "POLYGON ((0 0, 8 0, 8 4, 0 4, 0 0), (2 1, 3 1, 3 2, 2 2, 2 1))",
    "area.geojson": json.dumps({"type": "Polygon", "coordinates": _RINGS}),
}
_PIECES = {
    ".yaml": YAML_PIECES,
    ".csv": CSV_PIECES,
    **dict.fromkeys(
        (".wkt", ".geojson"),
        ("nan", "1e999", "-0", *"()[],", "EMPTY", "MULTIPOLYGON", "null", "8 4"),
    ),
}


def _save_decisions(path: Path) -> None:
    decisions = TimedDecisions(
        episode=[0, 1], time_s=[0.0, 0.5], state=[0, 1], action=[1, 0], next_state=[1, 2],
        dwell_s=[0.5, 1.0], censored=[False, False], source="bag a",
    )  # fmt: skip
    save_decisions(path, decisions)


def _save_flow(path: Path) -> None:
    count = np.ones(_GRID.n_states, dtype=np.int64)
    velocity = np.ones((_GRID.n_states, 2))
    flow = flow_of(_CORRIDOR, _GRID)
    save_flow(path, _GRID, FlowField(flow, velocity, count * 0.5, count))


def _save_episodes(path: Path) -> None:
    measured = (9.5, 9.5, 8.0, 0, 0, 0, 0.5, 1.0)
    write_rows(
        path, EpisodeResult, [EpisodeResult(1, 3, "expert", "train", "arrived", *measured)] * 3
    )


def _save_arrivals(path: Path) -> None:
    measured = (1.0, 2.0, 3.0, 4.0, 1.0)
    row = ArrivalRow(1, 3, 0.0, 0.5, 9.0, 1.0, "m", "arrived", "", *measured)
    write_rows(path, ArrivalRow, [row] * 3)


def _save_rows(path: Path) -> None:
    cells = {int: 1, float: 0.5, str: "a"}
    write_table(path, COLUMNS, [[cells[column.kind] for column in COLUMNS]] * 2)


def _save_tracks(path: Path) -> None:
    lines = (f"{n % 2},{n / 5},{0.5 * n},1.0\n" for n in range(12))
    path.write_text(f"id,t,x,y\n{''.join(lines)}")


def _save_unnamed_tracks(path: Path) -> None:
    lines = (f"{n % 2} {n // 2} {5.5 * n} 7.5 170\n" for n in range(12))
    path.write_text(f"# framerate: 25 fps\n{''.join(lines)}")


#: Writer of a valid file and its loader, by the name of the file.
_FILES: dict[str, tuple[Callable[[Path], object], Callable[[Path], object]]] = {
    "grid.yaml": (lambda path: save_grid(path, _GRID, "corridor"), load_grid),
    "decisions.csv": (_save_decisions, load_decisions),
    "flow.csv": (_save_flow, lambda path: load_flow(path, _GRID)),
    "episodes.csv": (_save_episodes, load_episodes),
    "arrivals.csv": (_save_arrivals, partial(read_rows, row_class=ArrivalRow)),
    "rows.csv": (_save_rows, lambda path: RowTable(path, COLUMNS, TASK_COLUMNS)),
    "tracks.csv": (_save_tracks, read_trajectories),
    "unnamed_tracks.csv": (_save_unnamed_tracks, read_trajectories),
    **{
        f"{name}.yaml": (
            lambda path, model=model: save_yaml_model(path, model),
            partial(load_yaml_model, model_class=type(model)),
        )
        for name, model in _MODELS.items()
    },
    **{
        f"{name}.yaml": (lambda path, text=text: path.write_bytes(text.read_bytes()), load)
        for name, (text, load) in _TEXTS.items()
    },
    **{
        name: (lambda path, area=area: path.write_text(area), read_area_m)
        for name, area in _AREAS.items()
    },
}


@pytest.mark.parametrize("name", ["model.yaml", *_FILES])
def test_a_mutated_file_loads_or_is_refused_in_one_line(name, tmp_path, save_model_of):
    path = tmp_path / name
    save, load = _FILES.get(name, (lambda _: save_model_of("corridor"), load_model))
    save(path)
    load(path)
    valid = path.read_bytes()
    cases = mutated_bytes(valid)
    cases |= mutated_text(valid.decode(), _PIECES[path.suffix]).map(_encoded)
    if path.suffix == ".yaml":
        cases |= mutated_yaml(valid.decode()).map(_encoded)

    @FUZZ
    @given(cases)
    def check(content: bytes) -> None:
        path.write_bytes(content)
        assert_loads_or_one_line(lambda: load(path))

    check()


@FUZZ
@given(
    mutated_text("live: {seed: 3, names: [a, 'b']}", YAML_PIECES)
    | mutated_text("seed:=3", YAML_PIECES)
    | st.sampled_from(YAML_PIECES)
    | st.text(max_size=20)
)
def test_a_mutated_assignment_gives_commands_or_is_refused_in_one_line(text):
    def commands(assignment: str) -> None:
        name, value = parse_assignment(assignment)
        for process in stack_processes(find_stack("live"), {name: value}, {}):
            assert b"\0" not in b"".join(map(os.fsencode, process.command))

    assert_loads_or_one_line(lambda: commands(text))
    assert_loads_or_one_line(lambda: commands(f"seed:={text}"))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")
