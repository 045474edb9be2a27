"""A node waits for the nodes of its own namespace."""

from types import SimpleNamespace

import pytest

from serd_ros.graph.readiness import Readiness


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
