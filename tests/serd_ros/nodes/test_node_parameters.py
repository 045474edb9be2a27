"""Every parameter of every node is described and fixed while the node runs."""

import re

import pytest

from serd_files.settings import settings_of
from serd_ros.errors import NodeError
from serd_ros.graph.graph import config_of, load_graph
from support.nodes_in_process import node_in_process

UNITS = {"s": "s", "m": "m", "mps": "m/s", "mps2": "m/s2", "radps": "rad/s", "hz": "Hz", "mb": "MB"}
#: Numbers that are counts or shares.
WITHOUT_RANGE = {"sensor_x", "sensor_y", "sensor_yaw"}


@pytest.fixture
def given(tmp_path, save_model_of, small_bag):
    return {
        "strategy": {"model": str(save_model_of())},
        "learner": {"output": str(tmp_path / "learned.yaml")},
        "demo_recorder": {"output": str(tmp_path / "bag")},
        "bag_replay": {"bag": str(small_bag())},
        "teleop_page": {"port": 0},
        "watch_page": {"port": 0},
        "hallway_sim": {"people": 0},
    }


def other_value(parameter):
    """A value of the same type that differs."""
    value = parameter.value
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return f"{value}x"
    return [*value, value[0]] if isinstance(value, list | tuple) else value + 1


@pytest.mark.usefixtures("nav2_server")
@pytest.mark.parametrize("kind", sorted(load_graph().nodes))
def test_every_parameter_is_described_and_refuses_to_be_set(kind, given):
    with node_in_process(kind, **given.get(kind, {})) as running:
        node, config = running.node, config_of(kind)
        for name in config.model_fields:
            described, parameter = node.describe_parameter(name), node.get_parameter(name)
            assert len(described.description) > 5, name
            assert described.type == parameter.type_.value, name
            assert not running.set(**{name: other_value(parameter)}).successful, name
            assert node.get_parameter(name).value == parameter.value
        running.assert_alive()


def test_every_number_has_its_unit_and_its_range():
    for kind in load_graph().nodes:
        for setting in settings_of(config_of(kind)):
            if setting.schema["type"] not in ("number", "integer"):
                continue
            assert setting.range or setting.name in WITHOUT_RANGE, setting.name
            suffix = re.search(r"_([a-z0-9]+)$", setting.name)
            if suffix and suffix[1] in UNITS:
                assert f"({UNITS[suffix[1]]})" in setting.description, setting.name


def test_an_empty_list_is_refused_by_its_name():
    sentence = "parameter of guard: observation_sources must have a value, got none; leave it out"
    with pytest.raises(NodeError, match=sentence), node_in_process("guard", observation_sources=[]):
        pass


def test_a_node_lives_on_after_use_sim_time_was_set_and_unset():
    with node_in_process("guard") as running:
        for value in (True, False):
            assert running.set(use_sim_time=value).successful
            running.call_timers()
        running.assert_alive()
