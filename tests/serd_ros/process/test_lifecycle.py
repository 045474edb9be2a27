"""The states of a managed node, its parameters in them, and what is left of it afterwards."""

from contextlib import contextmanager
from unittest.mock import Mock

import pytest
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_ros.convert.pose import to_pose_stamped
from serd_ros.graph.graph import config_of, load_graph
from serd_ros.settings import ManagedConfig
from support.nodes_in_process import deliver, node_in_process

MANAGED = sorted(kind for kind in load_graph().nodes if issubclass(config_of(kind), ManagedConfig))


@pytest.fixture
def managed(tmp_path, save_model_of):
    """Makes a managed node with the parameters that it needs; `to` makes transitions."""
    needed = {
        "strategy": {"model": str(save_model_of())},
        "learner": {"output": str(tmp_path / "learned.yaml")},
        "demo_recorder": {"output": str(tmp_path / "bag")},
    }

    @contextmanager
    def make(kind, **given):
        given = {"managed": True, **needed.get(kind, {}), **given}
        with node_in_process(kind, **given) as running:
            running.lifecycle = running.node.lifecycle
            yield running

    make.needed = needed
    return make


def to(running, *transitions):
    for each in transitions:
        getattr(running.lifecycle, f"trigger_{each}")()
    return running.lifecycle.state


def endpoints(running):
    kinds = "publishers", "subscriptions", "services", "clients", "timers", "waitables"
    return {kind: set(getattr(running.node, kind)) for kind in kinds}


def reported(running):
    return running.sent["diagnostics"].status[0].message


@pytest.mark.usefixtures("nav2_server")
@pytest.mark.parametrize("kind", MANAGED)
def test_parameters_can_be_set_as_the_state_allows_and_cleanup_leaves_what_there_was(kind, managed):
    config = config_of(kind)
    with managed(kind) as running:
        node = running.node

        def fixed():
            fields = config.model_fields
            return {name for name in fields if node.describe_parameter(name).read_only}

        def set_again(name):
            return running.set(**{name: node.get_parameter(name).value})

        for _ in range(2):
            before, attributes = endpoints(running), set(vars(node))
            assert fixed() == {"managed"}
            for name in config.model_fields:
                assert set_again(name).successful == (name != "managed"), name
            to(running, "configure")
            assert fixed() == set(config.model_fields) - set(config.changeable)
            for name in config.model_fields:
                assert "cannot be set while the node is inactive" in set_again(name).reason
            to(running, "activate")
            for name in fixed():
                assert f"{name} is fixed while the node runs" in set_again(name).reason
            assert endpoints(running)["subscriptions"] > before["subscriptions"]
            running.call_timers()
            assert to(running, "deactivate", "cleanup") == "unconfigured"
            assert endpoints(running) == before
            assert set(vars(node)) == attributes
        running.assert_alive()


def test_parameters_follow_the_one_on_which_their_defaults_depend(managed):
    with managed("local_planner") as running:
        node = running.node
        before = node.get_parameter("max_vel_x").value
        assert running.set(max_vel_x=0.75 * before).successful
        assert running.set(sim_time=1.5).successful
        assert node.get_parameter("max_vel_x").value == 0.75 * before
        refused = running.set(scenario="nowhere")
        assert not refused.successful
        assert "nowhere" in refused.reason
        assert running.set(use_sim_time=True, input_timeout_s=0.25).successful
        assert node.get_parameter("use_sim_time").value
        to(running, "configure")
        assert node.config.max_vel_x == 0.75 * before
        assert node.config.input_timeout_s == 0.25


def test_a_whole_number_for_a_float_and_another_prefix_are_taken_before_configuration(managed):
    with managed("people_tracker") as running:
        assert running.set(wall_margin=1, frame_prefix="robot1/").successful
        assert running.node.get_parameter("wall_margin").value == 1.0
        to(running, "configure")
        assert running.node.config.wall_margin == 1.0
        assert running.node.frames.prefix == "robot1/"


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
        assert lifecycle._state_machine.current_state[1] == "unconfigured"
        assert endpoints(running) == before
        assert node.callbacks.n_internal_errors == 1
        setattr(owner, name, whole)
        assert to(running, "configure", "activate") == "active"


def test_a_refusal_to_activate_leaves_an_inactive_node_and_its_sentence(managed, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "kept").touch()
    with managed("demo_recorder") as running:
        to(running, "configure")
        inactive = endpoints(running)
        assert to(running, "activate") == "inactive"
        assert "must be new or empty" in reported(running)
        assert endpoints(running) == inactive
        (tmp_path / "bag" / "kept").unlink()
        assert to(running, "activate") == "active"
        running.assert_alive()


def test_an_error_while_it_ends_its_work_leaves_an_unconfigured_node(managed, monkeypatch):
    with managed("demo_recorder") as running:
        before = endpoints(running)
        to(running, "configure", "activate")
        recorder = running.work._recorder
        with monkeypatch.context() as patch:
            error = BagError("the disk is full; make room")
            patch.setattr(recorder, "close", Mock(side_effect=error))
            assert to(running, "deactivate") == "unconfigured"
        recorder.close()
        assert endpoints(running) == before
        assert reported(running) == "deactivate refused: the disk is full; make room"


def test_what_was_due_when_its_endpoint_was_destroyed_does_nothing(managed):
    with managed("demo_recorder") as running:
        node = running.node
        to(running, "configure")
        earlier = set(node.services)
        to(running, "activate")
        timers, subscriptions = list(node.timers), list(node.subscriptions)
        (stop,) = [each for each in set(node.services) - earlier if "stop" in each.srv_name]
        to(running, "deactivate")
        for timer in timers:
            timer.callback()
        for subscription in subscriptions:
            deliver(subscription, b"")
        response = stop.callback(Trigger.Request(), Trigger.Response())
        assert not response.message
        stop.send_response(response, None)
        assert node.callbacks.n_rejected == 0
        running.assert_alive()


def test_a_model_that_is_missing_refuses_to_configure_until_another_one_is_set(managed, tmp_path):
    with managed("strategy", model=str(tmp_path / "absent.yaml")) as running:
        for _ in range(2):
            assert to(running, "configure") == "unconfigured"
            assert reported(running).startswith("configure refused: ")
            assert "absent.yaml" in reported(running)
        assert "timeout_s" in running.set(timeout_s=-1.0).reason
        assert running.set(**managed.needed["strategy"]).successful
        assert to(running, "configure", "activate") == "active"
        assert running.set(goal="3.5, 3.5").successful
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
