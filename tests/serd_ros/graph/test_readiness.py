"""A node waits for the nodes of its own namespace."""

from types import SimpleNamespace

import pytest

from serd_ros.graph.graph import PATIENCE_S, Readiness


@pytest.mark.parametrize(
    ("namespace", "missing"), [("/robot1", ""), ("/robot2", "node guard"), ("/", "node guard")]
)
def test_required_nodes_are_looked_for_in_the_own_namespace(namespace, missing):
    node = SimpleNamespace(
        get_namespace=lambda: namespace,
        get_node_names_and_namespaces=lambda: [("guard", "/robot1"), ("strategy", namespace)],
        publishers=[],
    )
    assert Readiness(node, ["guard", ""], 0.0).missing(0.0) == missing


def test_patience_begins_with_the_last_node_or_subscription_that_has_appeared():
    """A learner that starts late is present long before it subscribes."""
    present, count = [], [0]
    poses = SimpleNamespace(topic_name="/robot_pose", get_subscription_count=lambda: count[0])
    node = SimpleNamespace(
        get_namespace=lambda: "/",
        get_node_names_and_namespaces=lambda: present,
        count_subscribers=lambda _: count[0],
        resolve_topic_name=lambda name: f"/{name}",
        publishers=[poses],
    )
    readiness = Readiness(node, ["learner"], 0.0)
    assert readiness.missing(3.0 * PATIENCE_S) == "node learner"
    present.append(("learner", "/"))
    assert readiness.missing(4.0 * PATIENCE_S) == "subscribers of /robot_pose"
    assert readiness.missing(4.9 * PATIENCE_S) == "subscribers of /robot_pose"
    assert readiness.missing(5.0 * PATIENCE_S) == ""  # it is configured to subscribe to less
    count[0] = 1
    assert readiness.missing(5.1 * PATIENCE_S) == ""
