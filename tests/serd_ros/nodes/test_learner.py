"""The learner's parameter `actions`: what it subscribes to, and the methods it accepts."""

from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from serd_app.demonstrations.decision_table import load_decisions
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.drives.drive import EpisodeMark
from serd_app.errors import AppError
from serd_app.learning.checkpoint import CheckpointFolder, LearnerMemory
from serd_bag.errors import FileError
from serd_core.semi_markov.timed_decisions import TimedDecisions
from serd_ros.convert.diagnostics import to_diagnostics, to_episode_message
from serd_ros.errors import NodeError
from serd_ros.process.serd_node import SerdNode
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.nodes_in_process import node_in_process
from support.valid_messages import valid_message
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
        ({"actions": "hidden", "method": "mdce_irl"}, AppError, "are hidden, got mdce_irl"),
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


def take_pose(running, time_s):
    running.receive("robot_pose", serialize_message(valid_message("robot_pose", time_s)))


@pytest.mark.parametrize("received", ["nothing", "poses", "an episode without its last pose"])
def test_a_learner_of_a_replay_without_a_whole_episode_ends_with_the_reason(
    received, tmp_path, capsys
):
    output = str(tmp_path / "m.yaml")
    with node_in_process("learner", exit_with_publishers=True, output=output) as running:
        node = running.node
        if received != "nothing":
            take_pose(running, 1.0)
        if received.startswith("an episode"):
            mark = EpisodeMark("end", 9.0, 1, "scripted_expert", 0, "train", outcome="arrived")
            running.receive("episode", serialize_message(to_episode_message(mark)))
        running.receive("diagnostics", to_diagnostics("bag_replay", 9.0, {}, message="finished"))
        assert not node.finished.done()
        for _ in range(3):
            running.wait(1.0)
            running.call_timers()
        assert node.finished.result() == 2
    assert "no model was learned" in capsys.readouterr().err


def test_a_learner_waits_for_a_replay_that_pauses(tmp_path):
    output = str(tmp_path / "m.yaml")
    with node_in_process("learner", exit_with_publishers=True, output=output) as running:
        node = running.node
        node.create_publisher(PoseStamped, "robot_pose", 1)
        wait_until(lambda: node.count_publishers("robot_pose"))
        running.receive("diagnostics", to_diagnostics("bag_replay", 9.0, {}, message="paused"))
        take_pose(running, 1.0)
        for _ in range(2):
            running.wait(10.0)
            running.call_timers()
        assert not node.finished.done()


def test_a_learner_logs_why_it_does_not_begin_at_the_weights_that_were_kept(tmp_path, monkeypatch):
    hallway, warnings = load_scenario("hallway"), []
    memory = LearnerMemory(hallway, tmp_path / "m_learner")
    decisions = TimedDecisions([0], [0.0], [0], [0], [0], "a test", dwell_s=[1.0], censored=[False])
    kept = memory.folder.new().model_copy(update={"reward_weights": {"speed": 1.0}})
    memory.folder.save_decisions(decisions)
    memory.folder.save(kept)
    logger = SimpleNamespace(warning=warnings.append, info=lambda *_, **__: None)
    monkeypatch.setattr(SerdNode, "get_logger", lambda _: logger)
    given = {"output": str(tmp_path / "m.yaml"), "learn_on": "call"}
    with node_in_process("learner", **given):
        (warning,) = warnings
    assert "reward_weights of its checkpoint must be those of" in warning


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
    decisions = found
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
