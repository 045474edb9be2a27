"""Which worlds of others keep a driver from beginning an episode, and a reset without an answer."""

import math

import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from serd_app.drives.drive import END
from serd_app.navigation.navigator import ArrivalRow
from serd_files.table import load_episodes, read_rows
from serd_ros.convert.diagnostics import UNCOUNTED, from_episode_message, to_diagnostics
from serd_ros.convert.motion import to_pose_stamped
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_ros.graph.graph import several_worlds
from serd_sim.episodes.episode import EpisodeStart
from support.nav2_server import answered
from support.nodes_in_process import node_in_process
from support.observations import observation_at
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
        starter = running.work.runner._starter
        wait_until(
            lambda: not starter.waiting or "one publisher of" in starter._waited_for,
            turn=running.call_timers,
        )
        assert starter.waiting != is_ready


START = EpisodeStart(episode=0, seed=0, start_area="train", start_s=10.0)


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
        starter, world = running.work.runner._starter, SilentWorld()
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


def observe(running, time_s, y_m=3.5):
    running.observe(observation_at(2.5, y_m, 1.5, time_s=time_s))


def report(running, time_s, n_contacts):
    values = {**UNCOUNTED, "person_on_robot": n_contacts}
    running.receive("diagnostics", to_diagnostics("hallway_sim", time_s, values))


@pytest.mark.parametrize(
    ("reports", "n_contacts"),
    [
        (((10.0, 0), (10.5, 1), (12.0, 2)), 2),
        (((10.0, 0), (11.9, 1), (12.05, 2)), 1),
        (((12.2, 3),), 3),
    ],
)
def test_the_contacts_of_an_episode_are_those_at_its_last_tick(tmp_path, reports, n_contacts):
    given = {"required_nodes": [""], "timeout_s": 2.0, "episodes": 2, "output": str(tmp_path)}
    with node_in_process("scripted_expert", **given) as running:
        running.work.runner._starter.begin(START)
        for tick in range(41):
            observe(running, 10.0 + 0.05 * tick)
        assert running.work.runner.n_finished == 0
        for time_s, count in reports:
            report(running, time_s, count)
        assert running.work.runner.n_finished == 1
        mark = from_episode_message(running.sent["episode"])
        assert (mark.event, mark.time_s, mark.outcome) == (END, 12.0, "timeout")
        (row,) = load_episodes(tmp_path / "episodes.csv")
        assert (row.person_on_robot, row.duration_s) == (n_contacts, 2.0)


def test_a_driver_decides_in_each_cell_and_answers_a_tick_again_in_the_same_way():
    with node_in_process("scripted_expert", required_nodes=[""]) as running:
        running.work.runner._starter.begin(START)
        places_m = (3.5, 3.6, 3.9, 4.05, 4.15, 4.5)
        counts = []
        for tick, y_m in enumerate(places_m):
            observe(running, 10.0 + 0.05 * tick, y_m=y_m)
            counts.append(running.published["intent"])
        assert counts == [1, 1, 1, 1, 2, 2]
        decided = running.sent["intent"]
        for _ in range(2):
            observe(running, 10.25, y_m=4.5)
        assert running.published["intent"] > 2
        assert running.sent["intent"].vector == decided.vector
        assert stamp_s(running.sent["intent"].header.stamp) == pytest.approx(10.25)
        running.assert_alive()


def test_a_goal_where_the_robot_stands_is_reached_at_once(save_model_of):
    given = {"model": str(save_model_of()), "reset": False, "required_nodes": [""]}
    with node_in_process("strategy", **given) as running:
        running.call_timers()
        running.work.runner._starter._look.cancel()  # its graph is there
        observe(running, 10.0)
        running.receive("goal_pose", to_pose_stamped((2.5, 3.5, 0.0), 10.0))
        # It is planned in a thread, and its result is taken by a timer.
        wait_until(lambda: running.call_timers() or running.work.runner.n_finished == 1)
        assert from_episode_message(running.sent["episode"]).outcome == "arrived"
        running.assert_alive()


def test_no_progress_ends_the_episode_with_its_reason(save_model_of, tmp_path):
    given = {"model": str(save_model_of()), "required_nodes": [""], "output": str(tmp_path)}
    with node_in_process("strategy", lockstep=True, patience_decisions=4, **given) as running:
        running.work.runner._starter.begin(START)
        time_s = START.start_s
        while running.work.runner.n_finished == 0 and time_s < 60.0:
            observe(running, time_s)
            report(running, time_s, 0)
            time_s += 0.05
        mark = from_episode_message(running.sent["episode"])
        assert (mark.event, mark.outcome, mark.reason) == (END, "aborted", "no progress")
        (row,) = load_episodes(tmp_path / "episodes.csv")
        assert (row.outcome, row.reason) == ("aborted", "no progress")
        assert math.isnan(row.time_of_arrival_s)
        (arrival,) = read_rows(tmp_path / "arrivals.csv", ArrivalRow)
        assert arrival.reason == "no progress"
        running.assert_alive()
