"""The learner's parameter `actions`: what it subscribes to, and the methods it accepts."""

import numpy as np
import pytest
from std_srvs.srv import Trigger

from serd_app.demonstrations.decision_table import load_decisions
from serd_app.demonstrations.demonstrations import demonstrations_of_bag
from serd_app.errors import AppError
from serd_app.learning.checkpoint import CheckpointFolder
from serd_bag.errors import FileError
from serd_ros.errors import NodeError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.nodes_in_process import node_in_process
from support.waiting import wait_until


@pytest.mark.parametrize("actions", ["recorded", "hidden"])
def test_intents_are_subscribed_unless_actions_are_hidden(tmp_path, actions):
    with node_in_process("learner", actions=actions, output=str(tmp_path / "m.yaml")) as running:
        subscribed = {each.topic_name.strip("/") for each in running.node.subscriptions}
    assert {"robot_pose", "episode"} <= subscribed
    assert ("intent" in subscribed) == (actions == "recorded")


@pytest.mark.parametrize(
    ("given", "error", "sentence"),
    [
        ({"actions": "hidden", "method": "policy_matching"}, AppError, "are hidden, got policy_ma"),
        ({"output": ""}, FileError, "it is a folder; name a file"),
        ({"decisions": "m.csv"}, NodeError, "must not be written over the model's files"),
        ({"decisions": "m.grid.csv"}, NodeError, "must not be written over the model's files"),
        ({"decisions": "link/m.csv"}, NodeError, "must not be written over the model's files"),
    ],
)
def test_what_cannot_be_learned_or_written_is_rejected_at_the_start(
    given, error, sentence, tmp_path
):
    (tmp_path / "link").symlink_to(tmp_path)
    paths = {name: str(tmp_path / given[name]) for name in ("output", "decisions") if name in given}
    given = {"output": str(tmp_path / "m.yaml"), **given, **paths}
    with pytest.raises(error, match=sentence), node_in_process("learner", **given):
        pass


@pytest.fixture
def shipped(root):
    """The recording of the hallway that is part of the repository."""
    return next(path.parent for path in sorted((root / "bags/data").rglob("metadata.yaml")))


def test_decisions_without_actions_are_made_of_the_poses_of_a_bag_alone(shipped, tmp_path):
    table = tmp_path / "decisions.csv"
    given = {"bag": str(shipped), "actions": "hidden", "decisions": str(table)}
    with node_in_process("learner", output=str(tmp_path / "m.yaml"), **given) as running:
        wait_until(lambda: "diagnostics" in running.sent, turn=running.call_timers)
        assert running.sent["diagnostics"].status[0].message == "learning"
    assert load_decisions(table).hidden.all()


@pytest.mark.parametrize("n_decisions", [5, None])
def test_a_call_to_learn_is_answered_by_whether_there_are_decisions_enough(
    n_decisions, shipped, tmp_path
):
    hallway = load_scenario("hallway")
    grid, folder = grid_of(hallway), CheckpointFolder(tmp_path / "m_learner", hallway)
    found, _ = demonstrations_of_bag(shipped, grid, hallway.patience_s, hallway.wait_s)
    decisions = found.decisions
    folder.save_decisions(decisions.select(np.arange(n_decisions or len(decisions))))
    folder.save(folder.new())
    given = {"output": str(tmp_path / "m.yaml"), "learn_on": "call"}
    with node_in_process("learner", **given) as running:
        answer = running.call("learn", Trigger.Request())
        assert answer.success == (n_decisions is None)
        if n_decisions is None:
            assert answer.message.startswith("learning begins now")
        else:
            sentence = "at least minimum_decisions = 20 decisions are needed to learn, got 5"
            assert sentence in answer.message
            assert not running.node.finished.done()
            assert not (tmp_path / "m.yaml").exists()
