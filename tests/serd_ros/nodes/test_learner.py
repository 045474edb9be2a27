"""What the learner refuses at its start, and how it answers a call to learn."""

import numpy as np
import pytest
from std_srvs.srv import Trigger

from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.learning.checkpoint import CheckpointFolder
from serd_bag.errors import FileError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.nodes_in_process import node_in_process


@pytest.mark.parametrize(
    ("given", "error", "sentence"),
    [
        ({"output": ""}, FileError, "it is a folder; name a file"),
        ({"decisions": ""}, FileError, "it is a folder; name a file"),
    ],
)
def test_what_cannot_be_learned_or_written_is_rejected_at_the_start(
    given, error, sentence, tmp_path
):
    paths = {name: str(tmp_path / given[name]) for name in ("output", "decisions") if name in given}
    given = {"output": str(tmp_path / "m.yaml"), **given, **paths}
    with pytest.raises(error, match=sentence), node_in_process("learner", **given):
        pass


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
