"""Values for a node's config: defaults, ranges and types, each fault a sentence."""

import pytest

from serd_ros.errors import NodeError
from serd_ros.graph.graph import config_of, load_graph
from serd_ros.nodes.hallway_sim import HallwaySimConfig
from serd_ros.nodes.learner import LearnerConfig
from serd_ros.process.parameters import validated


@pytest.mark.parametrize("node", sorted(load_graph().nodes))
def test_the_defaults_of_every_node_are_valid(node):
    config = config_of(node)
    assert validated(node, {}, config) == config(**config.defaults({}))


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"seed": -1}, "seed must be greater than or equal to 0, got -1"),
        (
            {"command_timeout_s": 0.8},
            "command_timeout_s must be less than or equal to 0.5, got 0.8",
        ),
        ({"gui": "yes"}, "gui must be a boolean, got 'yes'"),
        ({"lockstep_timeout_s": float("nan")}, "lockstep_timeout_s must be a finite number"),
    ],
)
def test_a_bad_value_names_the_parameter_the_rule_and_the_value(values, sentence):
    with pytest.raises(NodeError, match=f"parameter of hallway_sim: {sentence}"):
        validated("hallway_sim", values, HallwaySimConfig)


def test_a_whole_number_is_taken_for_a_float():
    assert validated("learner", {"pseudo_count": 1}, LearnerConfig).pseudo_count == 1.0
