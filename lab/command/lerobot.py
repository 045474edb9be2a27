"""`python -m lab lerobot`: recordings as a LeRobot dataset, format v3.0, for other libraries.

A frame every 0.1 s from the first command of an episode for as long as one is in force:
`observation.state` is the place (x, y) in m, `action` the direction (east, north) of the command,
(0, 0) to wait. An episode is divided where no command is in force. `meta/info.json` is written
last.
"""

import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from serd_app.demonstrations.recorded import demonstrations_of_all, read_recordings
from serd_app.drives.drive import RecordedDrive
from serd_app.drives.mapping import BagMapping
from serd_app.errors import AppError
from serd_bag.files import atomic_write_bytes, atomic_write_text
from serd_cli.errors import UsageError
from serd_core.arrays import FloatArray
from serd_core.grid.grid import DIRECTION_VECTORS
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario

if TYPE_CHECKING:
    import pandas as pd

_FPS = 10
_VERSION = "v3.0"
_TASK = "drive to the goal"
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES, _TASKS = "meta/episodes/chunk-000/file-000.parquet", "meta/tasks.parquet"
_INFO, _STATS = "meta/info.json", "meta/stats.json"
_VECTORS = {"observation.state": ("x_m", "y_m"), "action": ("east", "north")}
_COUNTS = ("frame_index", "episode_index", "index", "task_index")
_STAMP_TOLERANCE_S = 1e-6


#: (T, 2) places and directions, a row per frame.
_Episode = tuple[FloatArray, FloatArray]


def lerobot(
    bags: Annotated[list[Path], typer.Argument(metavar="BAG", help="bag folders or files")],
    output: Annotated[Path, typer.Option(help="new folder for the dataset")],
    scenario: Annotated[
        str, typer.Option(help="built-in scenario or YAML file they were recorded in")
    ] = "hallway",
    mapping: Annotated[
        Path | None, typer.Option(help="YAML file that maps the topics of a bag")
    ] = None,
) -> None:
    """Write all episodes of recordings as a LeRobot dataset, format v3.0; needs pyarrow.

    python -m lab lerobot BAG --output dataset

    Ten frames per second have the place as observation.state and the direction of the command in
    force as action.
    """
    place = load_scenario(scenario)
    chosen = load_yaml_model(mapping, BagMapping) if mapping is not None else None
    recordings = read_recordings(bags, mapping=chosen, scenario=place)
    grid = grid_of(place)
    for found in demonstrations_of_all(recordings.all, grid, place.patience_s, place.wait_s):
        if found.decisions.hidden.any():
            raise UsageError(
                f"a dataset needs actions, which are hidden in {found.bag}; set action_from: motion"
                " in a --mapping to take the displacement as action"
            )
    drives = [drive for each in recordings.all for drive in each.drives]
    n_episodes = save_lerobot(output, drives, place.patience_s)
    print(f"{n_episodes} episodes: {output.resolve()}")


def save_lerobot(folder: Path, drives: Sequence[RecordedDrive], patience_s: float) -> int:
    """Write the dataset into a new folder; the number of episodes. AppError where it is not new.

    patience_s: how long a command of a drive without a limit of its own is in force.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise AppError(f"dataset folder {folder} must be new or empty; choose another name")
    episodes = [each for drive in drives for each in _episodes(drive, patience_s)]
    if not episodes:
        raise AppError("a dataset must have at least one episode with a decision, got none")
    frames = _frames(episodes)
    _write(folder / _DATA.format(chunk_index=0, file_index=0), _table(frames))
    _write(folder / _EPISODES, _table(_described(frames, [len(state) for state, _ in episodes])))
    _write(folder / _TASKS, _table({"task_index": np.zeros(1, np.int64)}).set_axis([_TASK]))
    atomic_write_text(folder / _STATS, json.dumps(_statistics(frames), indent=2))
    atomic_write_text(
        folder / _INFO, json.dumps(_info(len(episodes), len(frames["index"])), indent=2)
    )
    return len(episodes)


def _episodes(drive: RecordedDrive, patience_s: float) -> Iterator[_Episode]:
    hold_s = patience_s if drive.intent_hold_s is None else drive.intent_hold_s
    for span in drive.episodes:
        inside = (drive.intent_time_s >= span.start_s) & (drive.intent_time_s < span.end_s)
        rows = np.flatnonzero(inside)
        if not span.demonstrates or not len(rows):
            continue
        pauses_s = np.diff(drive.intent_time_s[rows])
        late = np.flatnonzero(pauses_s > hold_s + _STAMP_TOLERANCE_S) + 1
        for part in np.split(rows, late):
            yield _episode(drive, part, hold_s, span.end_s)


def _episode(drive: RecordedDrive, rows: Any, hold_s: float, end_s: float) -> _Episode:
    decided_s = drive.intent_time_s[rows]
    last_s = min(decided_s[-1] + hold_s, end_s)
    n_frames = max(1, round((last_s - decided_s[0]) * _FPS))
    at_s = decided_s[0] + np.arange(n_frames) / _FPS
    places = [np.interp(at_s, drive.pose_time_s, each) for each in drive.position_m.T]
    in_force = np.searchsorted(decided_s, at_s + 0.5 / _FPS, side="right") - 1
    actions = drive.intent_action[rows][np.maximum(in_force, 0)]
    return np.stack(places, axis=1), np.asarray(DIRECTION_VECTORS[actions], np.float64)


def _frames(episodes: Sequence[_Episode]) -> dict[str, Any]:
    """The columns of the data, a row per frame."""
    lengths = [len(state) for state, _ in episodes]
    frame = np.concatenate([np.arange(length) for length in lengths])
    return {
        "observation.state": np.concatenate([state for state, _ in episodes]).astype(np.float32),
        "action": np.concatenate([action for _, action in episodes]).astype(np.float32),
        "timestamp": (frame / _FPS).astype(np.float32),
        "frame_index": frame,
        "episode_index": np.repeat(np.arange(len(lengths)), lengths),
        "index": np.arange(len(frame)),
        "task_index": np.zeros(len(frame), np.int64),
    }


def _described(frames: dict[str, Any], lengths: Sequence[int]) -> dict[str, Any]:
    """The columns of the episodes: where each is in the data, and its statistics."""
    ends = np.cumsum(lengths)
    zeros = np.zeros(len(lengths), np.int64)
    columns: dict[str, Any] = {
        "episode_index": np.arange(len(lengths)),
        "tasks": [[_TASK]] * len(lengths),
        "length": np.array(lengths),
        "data/chunk_index": zeros,
        "data/file_index": zeros,
        "dataset_from_index": ends - lengths,
        "dataset_to_index": ends,
        "meta/episodes/chunk_index": zeros,
        "meta/episodes/file_index": zeros,
    }
    pieces = [slice(end - length, end) for end, length in zip(ends, lengths, strict=True)]
    parts = [_statistics({key: each[rows] for key, each in frames.items()}) for rows in pieces]
    for key, measures in parts[0].items():
        for name in measures:
            columns[f"stats/{key}/{name}"] = [part[key][name] for part in parts]
    return columns


def _statistics(frames: dict[str, Any]) -> dict[str, dict[str, list[float]]]:
    """Of each column: min, max, mean and standard deviation of each number, and the count."""
    return {
        key: {
            **{
                name: np.atleast_1d(measure(values.astype(np.float64), axis=0)).tolist()
                for name, measure in (
                    ("min", np.min),
                    ("max", np.max),
                    ("mean", np.mean),
                    ("std", np.std),
                )
            },
            "count": [len(values)],
        }
        for key, values in frames.items()
    }


def _info(n_episodes: int, n_frames: int) -> dict[str, Any]:
    features: dict[str, Any] = {
        key: {"dtype": "float32", "shape": [2], "names": list(names)}
        for key, names in _VECTORS.items()
    }
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    features |= {key: {"dtype": "int64", "shape": [1], "names": None} for key in _COUNTS}
    return {
        "codebase_version": _VERSION,
        "robot_type": None,
        "total_episodes": n_episodes,
        "total_frames": n_frames,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": _FPS,
        "splits": {"train": f"0:{n_episodes}"},
        "data_path": _DATA,
        "video_path": None,
        "features": features,
    }


def _table(columns: dict[str, Any]) -> "pd.DataFrame":
    import pandas as pd

    rows = {key: list(each) if np.ndim(each) > 1 else each for key, each in columns.items()}
    return pd.DataFrame(rows)


def _write(path: Path, table: "pd.DataFrame") -> None:
    content = io.BytesIO()
    try:
        table.to_parquet(content, engine="pyarrow")
    except ImportError:
        raise AppError("a LeRobot dataset needs pyarrow; install it: pip install pyarrow") from None
    atomic_write_bytes(path, content.getvalue())
