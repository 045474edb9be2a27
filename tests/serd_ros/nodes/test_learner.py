"""The learner's parameter `actions`: what it subscribes to, and the methods it accepts."""

import pytest

from serd_app.errors import AppError
from support.nodes_in_process import node_in_process


@pytest.mark.parametrize("actions", ["recorded", "hidden"])
def test_intents_are_subscribed_unless_actions_are_hidden(tmp_path, actions):
    with node_in_process("learner", actions=actions, output=str(tmp_path / "m.yaml")) as running:
        subscribed = {each.topic_name.strip("/") for each in running.node.subscriptions}
    assert {"robot_pose", "episode"} <= subscribed
    assert ("intent" in subscribed) == (actions == "recorded")


def test_a_method_that_counts_actions_is_rejected_at_the_start(tmp_path):
    given = {"actions": "hidden", "method": "policy_matching", "output": str(tmp_path / "m.yaml")}
    with (
        pytest.raises(AppError, match="where actions are hidden, got policy_matching"),
        node_in_process("learner", **given),
    ):
        pass
