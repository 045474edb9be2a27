"""What the learner refuses at its start, and how it answers a call to learn."""

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.learning.checkpoint import CheckpointFolder
from serd_bag.errors import FileError
from serd_ros.convert.diagnostics import to_diagnostics
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.nodes_in_process import node_in_process
from support.valid_messages import valid_message


@pytest.mark.parametrize("name", ["output", "decisions"])
def test_what_cannot_be_written_is_rejected_at_the_start(name, tmp_path):
    learner = node_in_process(
        "learner", **{"output": str(tmp_path / "m.yaml"), name: str(tmp_path)}
    )
    with pytest.raises(FileError, match="it is a folder; name a file"), learner:
        pass


@pytest.mark.parametrize("received", ["nothing", "an episode without its last pose"])
def test_a_learner_of_a_replay_without_a_whole_episode_ends_with_the_reason(
    received, tmp_path, capsys, messages
):
    output = str(tmp_path / "m.yaml")
    with node_in_process("learner", exit_with_publishers=True, output=output) as running:
        node = running.node
        running.wait(10.0)
        running.call_timers()
        assert not node.finished.done()  # the replay is still to come
        if received != "nothing":
            running.receive("robot_pose", serialize_message(valid_message("robot_pose", 1.0)))
            running.receive("episode", messages.mark(9.0, "end", 1, "arrived"))
        running.receive("diagnostics", to_diagnostics("bag_replay", 9.0, {}, message="finished"))
        assert not node.finished.done()
        for _ in range(3):
            running.wait(1.0)
            running.call_timers()
        assert node.finished.result() == 2
    assert "no model was learned" in capsys.readouterr().err


@pytest.fixture
def shipped(root):
    """The recording of the hallway that is part of the repository."""
    return next(path.parent for path in sorted((root / "bags/data").rglob("metadata.yaml")))


@pytest.mark.parametrize("n_decisions", [5, None])
def test_a_call_to_learn_is_answered_by_whether_there_are_decisions_enough(
    n_decisions, shipped, tmp_path
):
    hallway = load_scenario("hallway")
    grid, folder = grid_of(hallway), CheckpointFolder(tmp_path / "m_learner", hallway)
    found, _ = demonstrations_of_bag(shipped, grid, hallway.patience_s, hallway.wait_s)
    folder.save_decisions(found.select(np.arange(n_decisions or len(found))))
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
