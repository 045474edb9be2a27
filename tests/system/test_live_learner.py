"""A learner of live topics: its table equals that of a recording, and it resumes after a kill."""

import signal
from pathlib import Path

import numpy as np
import pytest
from std_msgs.msg import String
from std_srvs.srv import Trigger

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_app.demonstrations.demonstrations import Demonstrations, demonstrations_of_bag
from serd_app.learning.checkpoint import CheckpointFolder, LearnerCheckpoint
from serd_files.model_file import ModelFile, load_model
from serd_files.yaml_config import yaml_model
from serd_ros.endpoints import qos
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


@pytest.fixture
def models(probe) -> list[ModelFile]:
    """Every model published so far."""
    found: list[ModelFile] = []
    probe.node.create_subscription(
        String,
        "model",
        lambda message: found.append(yaml_model(message.data, ModelFile, name="model")),
        qos.LATCHED,
    )
    return found


def table_without_source(path: Path) -> list[str]:
    return [line.rsplit(",", 1)[0] for line in path.read_text().splitlines()]


def shipped_demonstrations(root: Path) -> Demonstrations:
    bag = sorted(path.parent for path in (root / "bags" / "data").rglob("metadata.yaml"))[0]
    return demonstrations_of_bag(bag, GRID, HALLWAY.patience_s, HALLWAY.wait_s)[0]


def test_decisions_from_live_topics_equal_those_of_the_recording(
    nodes, probe, models, quick_hallway, tmp_path
):
    started = nodes.start_stack(
        "demonstrate_and_learn",
        scenario=quick_hallway,
        hallway_sim__people=6,
        seed=3,
        scripted_expert__episodes=2,
        demo_recorder__output=str(tmp_path / "bag"),
        learner__output=str(tmp_path / "model.yaml"),
        learner__decisions=str(tmp_path / "live.csv"),
    )
    probe.spin_until(lambda: started["scripted_expert"].poll() is not None)
    probe.spin_until(lambda: bool(models) and models[-1].fit.n_episodes == 2)
    nodes.end_all()
    offline, _ = demonstrations_of_bag(tmp_path / "bag", GRID, HALLWAY.patience_s, HALLWAY.wait_s)
    save_decisions(tmp_path / "offline.csv", offline.decisions)
    live = table_without_source(tmp_path / "live.csv")
    assert live == table_without_source(tmp_path / "offline.csv")
    assert load_model(tmp_path / "model.yaml") == models[-1]
    assert [model.fit.n_episodes for model in models] == sorted(
        {model.fit.n_episodes for model in models}
    )


def test_poses_of_a_bag_alone_are_learned_from(nodes, probe, models, root, tmp_path):
    bag = sorted(path.parent for path in (root / "bags" / "data").rglob("metadata.yaml"))[0]
    table = tmp_path / "decisions.csv"
    nodes.start_stack(
        "learn",
        bag=str(bag),
        actions="hidden",
        output=str(tmp_path / "model.yaml"),
        decisions=str(table),
        exit_when_done=False,
    )
    probe.spin_until(lambda: bool(models))
    assert load_decisions(table).hidden.all()
    assert models[-1].fit.hidden_log_likelihood < 0
    assert models[-1].fit.policy_log_likelihood == 0


def test_a_learner_killed_in_a_long_fit_resumes_from_its_last_checkpoint(
    nodes, probe, models, root, tmp_path
):
    demonstrations = shipped_demonstrations(root)
    folder = CheckpointFolder(tmp_path / "kept", HALLWAY)
    folder.save_decisions(demonstrations.decisions)
    folder.save(folder.new())
    given = {"output": str(tmp_path / "model.yaml"), "state": str(folder.path)}
    given["prior_weights"] = [0.001 * number for number in range(1, 1000)]

    def stands_at() -> LearnerCheckpoint:
        kept = folder.load()
        assert kept is not None
        return kept[0]

    first = nodes.start_stack("learn", **given)["learner"]
    probe.spin_until(lambda: stands_at().step > 0)
    first.send_signal(signal.SIGKILL)
    first.wait()
    assert stands_at().n_learned == 0
    assert not models
    # The second compares no weights, so that it ends soon.
    nodes.start_stack("learn", **(given | {"prior_weights": [0.1]}))
    probe.spin_until(lambda: bool(models))
    assert models[-1].fit.n_decisions == len(demonstrations.decisions)
    probe.spin_until(lambda: stands_at().n_learned == len(demonstrations.decisions))


@pytest.mark.parametrize("n_decisions", [5, None])
def test_a_call_to_learn_is_answered_by_whether_there_are_decisions_enough(
    n_decisions, nodes, probe, models, root, tmp_path
):
    decisions = shipped_demonstrations(root).decisions
    folder = CheckpointFolder(tmp_path / "kept", HALLWAY)
    folder.save_decisions(decisions.select(np.arange(n_decisions or len(decisions))))
    folder.save(folder.new())
    given = {"output": str(tmp_path / "model.yaml"), "state": str(folder.path)}
    learner = nodes.start_stack("learn", learn_on="call", **given)["learner"]
    client = probe.node.create_client(Trigger, "learn")
    probe.spin_until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    probe.spin_until(answer.done)
    assert answer.result().success == (n_decisions is None)
    if n_decisions is None:
        assert answer.result().message.startswith("learning begins now")
        probe.spin_until(lambda: bool(models))
    else:
        sentence = "at least minimum_decisions = 20 decisions are needed to learn, got 5"
        assert sentence in answer.result().message
        assert learner.poll() is None
        assert not (tmp_path / "model.yaml").exists()
