"""Which worlds of others keep a driver from beginning an episode, and a reset without an answer."""

from types import SimpleNamespace

import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from serd_files.yaml_config import model_yaml
from serd_ros.endpoints import qos
from serd_ros.endpoints.world.worlds import several_worlds
from serd_ros.episodes.driver import EpisodeDriverNode
from serd_sim.scenario.scenario import load_scenario
from support.nav2_server import answered
from support.nodes_in_process import node_in_process
from support.waiting import wait_until


@pytest.mark.parametrize(
    ("kind", "topic", "profile", "pose_from", "is_ready"),
    [
        (Clock, "/clock", qos.CLOCK, "tf", True),
        (Clock, "/clock", qos.CLOCK, "robot_pose", True),
        (PoseStamped, "robot_pose", qos.STATE, "tf", True),
        (PoseStamped, "robot_pose", qos.STATE, "robot_pose", False),
    ],
)
def test_a_robot_without_a_simulator_depends_on_the_topics_that_it_follows(
    kind, topic, profile, pose_from, is_ready, save_model_of
):
    model = str(save_model_of())
    given = {"model": model, "reset": False, "pose_from": pose_from, "required_nodes": [""]}
    with node_in_process("strategy", **given) as running:
        for _ in range(2):
            running.node.create_publisher(kind, topic, profile)
        wait_until(lambda: several_worlds(running.node))
        node = running.node
        wait_until(
            lambda: node.ready or "one publisher of" in node._waited_for, turn=running.call_timers
        )
        assert node.ready == is_ready


class SilentWorld:
    """The service reset, which answers by hand."""

    def __init__(self):
        self.requests = []

    def service_is_ready(self):
        return True

    def call_async(self, _):
        self.requests.append(Future())
        return self.requests[-1]

    def answer(self, request, episode):
        start = {"episode": episode, "seed": 0, "start_area": "west", "start_s": 0.0}
        answered(request, Trigger.Response(success=True, message=yaml.safe_dump(start)))


def test_a_reset_without_an_answer_is_requested_again(save_model_of):
    given = {"model": str(save_model_of()), "required_nodes": [""]}
    with node_in_process("strategy", **given) as running:
        starter, world = running.node._starter, SilentWorld()
        starter._reset = world
        wait_until(lambda: world.requests, turn=running.call_timers)
        for waited_s, n_requests in ((29.0, 1), (2.0, 2), (29.0, 2)):
            running.wait(waited_s)
            running.call_timers()
            assert len(world.requests) == n_requests
        world.answer(world.requests[0], 1)
        assert starter.episode is None
        world.answer(world.requests[1], 2)
        assert starter.episode.episode == 2
        running.wait(31.0)
        running.call_timers()
        assert len(world.requests) == 2


@pytest.mark.parametrize(("speed_mps", "n_warnings"), [(1.2, 0), (0.4, 1)])
def test_a_driver_warns_of_a_period_too_short_for_the_next_cell(
    tmp_path, monkeypatch, speed_mps, n_warnings
):
    slow = load_scenario("corridor").with_values("robot", max_vel_x_mps=speed_mps)
    (tmp_path / "slow.yaml").write_text(model_yaml(slow))
    warnings = []
    logger = SimpleNamespace(warning=warnings.append, info=lambda *_, **__: None)
    monkeypatch.setattr(EpisodeDriverNode, "get_logger", lambda _: logger)
    given = {"scenario": str(tmp_path / "slow.yaml"), "required_nodes": [""]}
    with node_in_process("scripted_expert", **given):
        assert warnings == [slow.period_remark] * n_warnings
