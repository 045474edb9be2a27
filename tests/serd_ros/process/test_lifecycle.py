"""The states of a managed node, and what is left of it afterwards."""

import pytest
from rclpy.serialization import serialize_message

from serd_bag.reader import BagReader
from serd_ros.convert.motion import to_pose_stamped
from serd_ros.graph.graph import config_of, load_graph
from serd_ros.settings import ManagedConfig
from support.nodes_in_process import needed_parameters, node_in_process

MANAGED = sorted(kind for kind in load_graph().nodes if issubclass(config_of(kind), ManagedConfig))


@pytest.fixture
def managed(tmp_path, save_model_of):
    """Makes a managed node with the parameters that it needs; `to` makes transitions."""
    needed = needed_parameters(tmp_path, save_model_of())
    return lambda kind, **given: node_in_process(
        kind, **{"managed": True, **needed.get(kind, {}), **given}
    )


def to(running, *transitions):
    for each in transitions:
        getattr(running.lifecycle, f"trigger_{each}")()
    return running.lifecycle._state_machine.current_state[1]


def endpoints(running):
    kinds = "publishers", "subscriptions", "services", "clients", "timers", "waitables"
    return {kind: set(getattr(running.node, kind)) for kind in kinds}


@pytest.mark.usefixtures("nav2_server")
@pytest.mark.parametrize("kind", MANAGED)
def test_a_node_works_while_it_is_active_and_cleanup_leaves_what_there_was(kind, managed):
    with managed(kind) as running:
        for _ in range(2):
            before, attributes = endpoints(running), set(vars(running.node))
            assert to(running, "configure", "activate") == "active"
            assert endpoints(running)["subscriptions"] > before["subscriptions"]
            running.call_timers()
            assert to(running, "deactivate", "cleanup") == "unconfigured"
            assert endpoints(running) == before
            assert set(vars(running.node)) == attributes
        running.assert_alive()


@pytest.mark.parametrize("step", ["configure", "activate", "deactivate"])
def test_an_unexpected_exception_in_a_transition_leaves_an_unconfigured_node(step, managed):
    with managed("strategy") as running:
        node, lifecycle, before = running.node, running.lifecycle, endpoints(running)
        steps = ["configure", "activate", "deactivate"]
        to(running, *steps[: steps.index(step)])
        owner, name = {
            "configure": (node, "configure"),
            "activate": (lifecycle, "_activate"),
            "deactivate": (lifecycle.activity, "deactivate"),
        }[step]
        whole = getattr(owner, name)

        def fail(*arguments):
            whole(*arguments)
            raise ZeroDivisionError("by a test")

        setattr(owner, name, fail)
        assert to(running, step) == "unconfigured"
        assert endpoints(running) == before
        assert node.callbacks.n_internal_errors == 1
        setattr(owner, name, whole)
        assert to(running, "configure", "activate") == "active"


def test_a_refusal_to_activate_leaves_an_inactive_node(managed, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "kept").touch()
    with managed("demo_recorder") as running:
        to(running, "configure")
        inactive = endpoints(running)
        assert to(running, "activate") == "inactive"
        assert endpoints(running) == inactive
        (tmp_path / "bag" / "kept").unlink()
        assert to(running, "activate") == "active"
        running.assert_alive()


def test_each_activation_of_the_recorder_has_a_bag_of_what_came_while_it_was_active(
    managed, tmp_path
):
    with managed("demo_recorder", topics=["robot_pose"], minimum_free_mb=0.0) as running:
        to(running, "configure")
        for number, bag in enumerate(("bag", "bag-2")):
            to(running, "activate")
            pose = serialize_message(to_pose_stamped((float(number), 0.0, 0.0), 1.0))
            running.receive("robot_pose", pose)
            to(running, "deactivate")
            (message,) = BagReader(tmp_path / bag).messages()
            assert message.data == pose
        to(running, "cleanup", "configure", "activate")
        assert (tmp_path / "bag-3").is_dir()
