"""`python -m lab lerobot`: the shipped recordings as a dataset, and recordings without actions."""

import json

import pytest

from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter

pytest.importorskip("pyarrow")


def test_all_episodes_of_a_bag_are_written(lab, root, tmp_path):
    bag = root / "bags" / "data" / "hallway" / "test"
    ended = lab("lerobot", bag, "--output", tmp_path / "dataset")
    assert ended.code == 0, ended.err
    info = json.loads((tmp_path / "dataset" / "meta" / "info.json").read_text())
    assert ended.out == f"{info['total_episodes']} episodes: {tmp_path / 'dataset'}\n"
    assert info["total_episodes"] >= 10
    again = lab("lerobot", bag, "--output", tmp_path / "dataset")
    assert again.code == 2
    assert "must be new or empty" in again.err


def test_a_bag_of_poses_alone_is_refused_with_the_fix(lab, root, tmp_path):
    bag = tmp_path / "poses"
    reader = BagReader(root / "bags" / "data" / "hallway" / "test")
    with BagWriter(bag) as writer:
        writer.add_topic("/somewhere/pose", reader.topics["/robot_pose"].type_name)
        for message in reader.messages(["/robot_pose"]):
            writer.write("/somewhere/pose", message.data, message.log_time_ns)
    ended = lab("lerobot", bag, "--output", tmp_path / "dataset")
    assert ended.code == 2
    assert "a dataset needs actions, which are hidden in" in ended.err
    assert not (tmp_path / "dataset").exists()
