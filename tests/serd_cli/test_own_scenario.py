"""A scenario of one's own, docs/scenarios.md's, from recording over learning to driving."""

import json
import re

import pytest


@pytest.fixture
def room(root, tmp_path):
    text = (root / "docs" / "scenarios.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```yaml\n(# room.yaml.*?)```", text, re.DOTALL)
    path = tmp_path / "room.yaml"
    path.write_text(example)
    return path


def test_the_documents_room_is_recorded_learned_and_driven_in(serd, room, drive_bag):
    bags = [drive_bag(f"drive-{x_m}", x_m=x_m) for x_m in (0.5, 1.5, 2.5, 3.5)]
    read = serd("demos", *bags, "--scenario", room, "--json")
    assert [each["n_decisions"] for each in json.loads(read.out)["bags"]] == [5, 5, 5, 5]
    room.unlink()  # table and model keep the scenario
    learned = serd("learn", "decisions.csv")
    assert learned.code == 0, learned.err
    driven = serd(
        "navigate", "model.yaml", "--episodes", "1", "--timeout-s", "10", "--output", "n", "--json"
    )
    assert driven.code == 0, driven.err
    assert json.loads(driven.out)["n_episodes"] == 1
