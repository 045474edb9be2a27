"""The states of a managed node, its parameters in them, and what is left of it afterwards."""

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
def given(tmp_path, save_model_of):
    return {
        "strategy": {"model": str(save_model_of())},
        "learner": {"output": str(tmp_path / "learned.yaml")},
        "demo_recorder": {"output": str(tmp_path / "bag")},
    }


def endpoints(node):
    kinds = "publishers", "subscriptions", "services", "clients", "timers", "waitables"
    return {kind: set(getattr(node, kind)) for kind in kinds}


@pytest.mark.usefixtures("nav2_server")
@pytest.mark.parametrize("kind", MANAGED)
def test_parameters_can_be_set_as_the_state_allows_and_cleanup_leaves_what_there_was(kind, given):
    config = config_of(kind)
    with node_in_process(kind, managed=True, **given.get(kind, {})) as running:
        node = running.node

        def fixed():
            fields = config.model_fields
            return {name for name in fields if node.describe_parameter(name).read_only}

        def set_again(name):
            return running.set(**{name: node.get_parameter(name).value})

        for _ in range(2):
            before, attributes = endpoints(node), set(vars(node))
            assert fixed() == {"managed"}
            for name in config.model_fields:
                assert set_again(name).successful == (name != "managed"), name
            node.lifecycle.trigger_configure()
            assert fixed() == set(config.model_fields) - set(config.changeable)
            for name in config.model_fields:
                assert "cannot be set while the node is inactive" in set_again(name).reason
            node.lifecycle.trigger_activate()
            for name in fixed():
                assert f"{name} is fixed while the node runs" in set_again(name).reason
            assert endpoints(node)["subscriptions"] > before["subscriptions"]
            running.call_timers()
            node.lifecycle.trigger_deactivate()
            node.lifecycle.trigger_cleanup()
            assert node.lifecycle.state == "unconfigured"
            assert endpoints(node) == before
            assert set(vars(node)) == attributes
        running.assert_alive()


def test_parameters_follow_the_one_on_which_their_defaults_depend():
    with node_in_process("local_planner", managed=True) as running:
        node = running.node
        before = node.get_parameter("max_vel_x").value

        assert running.set(max_vel_x=0.75 * before).successful
        assert running.set(planner="dwa_smooth").successful
        assert node.get_parameter("max_vel_x").value == 0.75 * before
        refused = running.set(scenario="nowhere")
        assert not refused.successful
        assert "nowhere" in refused.reason
        assert running.set(use_sim_time=True, input_timeout_s=0.25).successful
        assert node.get_parameter("use_sim_time").value
        node.lifecycle.trigger_configure()
        assert node.config.max_vel_x == 0.75 * before
        assert node.config.input_timeout_s == 0.25


def test_a_whole_number_for_a_float_and_another_prefix_are_taken_before_configuration():
    with node_in_process("people_tracker", managed=True) as running:
        assert running.set(wall_margin=1, frame_prefix="robot1/").successful
        assert running.node.get_parameter("wall_margin").value == 1.0
        running.node.lifecycle.trigger_configure()
        assert running.node.config.wall_margin == 1.0
        assert running.node.frames.prefix == "robot1/"


@pytest.mark.parametrize("step", ["configure", "activate", "deactivate"])
def test_an_unexpected_exception_in_a_transition_leaves_an_unconfigured_node(step, given):
    with node_in_process("strategy", managed=True, **given["strategy"]) as running:
        node, before = running.node, endpoints(running.node)
        owner, name = node.lifecycle, f"_{step}"
        if step != "configure":
            node.lifecycle.trigger_configure()
        if step == "deactivate":
            node.lifecycle.trigger_activate()
            owner, name = node.lifecycle.activity, step
        whole = getattr(owner, name)

        def fail(*arguments):
            whole(*arguments)
            raise ZeroDivisionError("by a test")

        setattr(owner, name, fail)
        getattr(node.lifecycle, f"trigger_{step}")()
        assert node.lifecycle.state == "unconfigured"
        assert node.lifecycle._state_machine.current_state[1] == "unconfigured"
        assert endpoints(node) == before
        assert node.callbacks.n_internal_errors == 1
        setattr(owner, name, whole)
        node.lifecycle.trigger_configure()
        node.lifecycle.trigger_activate()
        assert node.lifecycle.state == "active"


def test_a_refusal_to_activate_leaves_an_inactive_node_and_its_sentence(given, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "kept").touch()
    with node_in_process("demo_recorder", managed=True, **given["demo_recorder"]) as running:
        node = running.node
        node.lifecycle.trigger_configure()
        inactive = endpoints(node)
        node.lifecycle.trigger_activate()
        assert node.lifecycle.state == "inactive"
        assert "must be new or empty" in running.sent["diagnostics"].status[0].message
        assert endpoints(node) == inactive
        (tmp_path / "bag" / "kept").unlink()
        node.lifecycle.trigger_activate()
        assert node.lifecycle.state == "active"
        running.assert_alive()


def test_an_error_while_it_ends_its_work_leaves_an_unconfigured_node(given, monkeypatch):
    with node_in_process("demo_recorder", managed=True, **given["demo_recorder"]) as running:
        node, before = running.node, endpoints(running.node)
        node.lifecycle.trigger_configure()
        node.lifecycle.trigger_activate()
        recorder = running.work._recorder
        with monkeypatch.context() as patch:
            error = BagError("the disk is full; make room")
            patch.setattr(recorder, "close", Mock(side_effect=error))
            node.lifecycle.trigger_deactivate()
        recorder.close()
        assert node.lifecycle.state == "unconfigured"
        assert endpoints(node) == before
        reported = running.sent["diagnostics"].status[0]
        assert reported.message == "deactivate refused: the disk is full; make room"


def test_what_was_due_when_its_endpoint_was_destroyed_does_nothing(given):
    with node_in_process("demo_recorder", managed=True, **given["demo_recorder"]) as running:
        node = running.node
        node.lifecycle.trigger_configure()
        earlier = set(node.services)
        node.lifecycle.trigger_activate()
        timers, subscriptions = list(node.timers), list(node.subscriptions)
        (stop,) = [each for each in set(node.services) - earlier if "stop" in each.srv_name]
        node.lifecycle.trigger_deactivate()
        for timer in timers:
            timer.callback()
        for subscription in subscriptions:
            deliver(subscription, b"")
        response = stop.callback(Trigger.Request(), Trigger.Response())
        assert not response.message
        stop.send_response(response, None)
        assert node.callbacks.n_rejected == 0
        running.assert_alive()


def test_a_model_that_is_missing_refuses_to_configure_until_another_one_is_set(given, tmp_path):
    absent = str(tmp_path / "absent.yaml")
    with node_in_process("strategy", managed=True, model=absent) as running:
        node = running.node
        for _ in range(2):
            node.lifecycle.trigger_configure()
            assert node.lifecycle.state == "unconfigured"
            message = running.sent["diagnostics"].status[0].message
            assert message.startswith("configure refused: ")
            assert "absent.yaml" in message
        wrong = running.set(timeout_s=-1.0)
        assert "timeout_s" in wrong.reason
        assert running.set(model=given["strategy"]["model"]).successful
        node.lifecycle.trigger_configure()
        node.lifecycle.trigger_activate()
        assert node.lifecycle.state == "active"
        assert running.set(goal="3.5, 3.5").successful
        running.assert_alive()


def test_each_activation_of_the_recorder_has_a_bag_of_what_came_while_it_was_active(tmp_path):
    given = {"output": str(tmp_path / "bag"), "topics": ["robot_pose"], "minimum_free_mb": 0.0}
    with node_in_process("demo_recorder", managed=True, **given) as running:
        running.node.lifecycle.trigger_configure()
        for number, bag in enumerate(("bag", "bag-2")):
            running.node.lifecycle.trigger_activate()
            pose = to_pose_stamped((float(number), 0.0, 0.0), 1.0)
            running.receive("robot_pose", serialize_message(pose))
            running.node.lifecycle.trigger_deactivate()
            (message,) = BagReader(tmp_path / bag).messages()
            assert message.data == serialize_message(pose)
        running.node.lifecycle.trigger_cleanup()
        running.node.lifecycle.trigger_configure()
        running.node.lifecycle.trigger_activate()
        assert (tmp_path / "bag-3").is_dir()
