"""A LeRobot dataset as the documentation of format v3.0 describes it."""

import json

import numpy as np
import pytest

from lab.command.lerobot import save_lerobot
from serd_app.drives.drive import EpisodeSpan, RecordedDrive
from serd_core.grid.grid import Action

parquet = pytest.importorskip("pyarrow.parquet")


def drive(**changes):
    """10 s north at 1 m/s: commands at 0, 2 and 4 s, then at 8 s; a discarded episode follows."""
    time_s = np.arange(0.0, 16.01, 0.1)
    values = {
        "pose_time_s": time_s,
        "position_m": np.column_stack([np.full_like(time_s, 0.5), time_s]),
        "intent_time_s": np.array([0.0, 2.0, 4.0, 8.0, 12.0]),
        "intent_action": np.array([Action.NORTH, Action.EAST, Action.WAIT, Action.SOUTH, 1]),
        "episodes": (EpisodeSpan(0, 0.0, 9.0, "arrived"), EpisodeSpan(1, 12.0, 16.0, "discarded")),
    }
    return RecordedDrive(**values | changes)


@pytest.fixture
def dataset(tmp_path):
    assert save_lerobot(tmp_path / "set", [drive(), drive()], 2.0) == 4
    return tmp_path / "set"


def test_every_frame_has_the_place_and_the_command_in_force(dataset):
    table = parquet.read_table(dataset / "data/chunk-000/file-000.parquet")
    frames = table.to_pydict()
    assert len(frames["index"]) == 2 * (60 + 10)
    assert frames["index"] == list(range(140))
    first = slice(0, 60)
    np.testing.assert_allclose(frames["timestamp"][first], np.arange(60) / 10, atol=1e-6)
    assert frames["frame_index"][first] == list(range(60))
    np.testing.assert_allclose(frames["observation.state"][59], [0.5, 5.9], atol=1e-6)
    assert [frames["action"][row] for row in (0, 19, 20, 39, 40, 59, 60)] == [
        [0, 1], [0, 1], [1, 0], [1, 0], [0, 0], [0, 0], [0, -1]
    ]  # fmt: skip
    kinds = {field.name: str(field.type) for field in table.schema}
    assert (kinds["timestamp"], kinds["episode_index"]) == ("float", "int64")
    assert "float" in kinds["observation.state"]
    held = dataset.with_name("held")
    assert save_lerobot(held, [drive(intent_hold_s=4.0)], 2.0) == 1
    assert len(parquet.read_table(held / "data/chunk-000/file-000.parquet")) == 90


def test_the_description_names_every_column_and_episode(dataset):
    info = json.loads((dataset / "meta/info.json").read_text())
    table = parquet.read_table(dataset / info["data_path"].format(chunk_index=0, file_index=0))
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["fps"]) == (4, 140, 10)
    assert set(info["features"]) == set(table.column_names)
    assert set(json.loads((dataset / "meta/stats.json").read_text())) == set(table.column_names)
    episodes = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [each["length"] for each in episodes] == [60, 10, 60, 10]
    for each in episodes:
        rows = slice(each["dataset_from_index"], each["dataset_to_index"])
        assert table["episode_index"].to_pylist()[rows] == [each["episode_index"]] * each["length"]
        assert each["stats/action/count"] == [each["length"]]
        assert each["tasks"] == ["drive to the goal"]
