"""What each node does when the clock of its messages jumps forward, jumps backward or stands."""

from contextlib import contextmanager

import pytest
from rclpy.serialization import serialize_message

from serd_ros.convert.command import to_twist_stamped
from serd_ros.convert.stamp import Jump, StampClock, stamp_s
from serd_sim.episodes.episode import EpisodeStart
from serd_sim.world.command import Command
from support.nodes_in_process import node_in_process
from support.valid_messages import GOAL_M, valid_message

SECOND_NS = 1_000_000_000
OBSERVATION = ("pedestrians", "odom", "robot_pose")
START = 100.0


def feed(running, time_s, *topics):
    """The messages of these topics, then the subscribed ones of an observation, all at one time."""
    subscribed = {each.topic_name.strip("/") for each in running.node.subscriptions}
    for topic in (*topics, *(each for each in OBSERVATION if each in subscribed)):
        running.receive(topic, valid_message(topic, time_s))


def speed(running):
    running.call_timers()
    return running.sent["cmd_vel_raw"].linear.x


@pytest.mark.parametrize(
    ("steps_ns", "jump"),
    [
        ((0, 0), Jump.NONE),
        ((5, 5 + SECOND_NS), Jump.NONE),
        ((5, 6 + SECOND_NS), Jump.FORWARD),
        ((2 * SECOND_NS, SECOND_NS), Jump.LATE),
        ((2 * SECOND_NS, SECOND_NS - 1), Jump.BACKWARD),
        ((10, 4, 9), Jump.LATE),  # a late stamp does not move the clock back
    ],
)
def test_a_jump_is_a_step_of_more_than_a_second(steps_ns, jump):
    clock = StampClock()
    assert clock.advance(steps_ns[0]) is Jump.NONE
    assert {clock.advance(each) for each in steps_ns[1:]} == {jump}


@pytest.mark.parametrize(
    ("later_s", "people_from"), [(START + 1.5, "given"), (START - 1.5, "scan"), (0.0, "given")]
)
def test_the_planner_stands_after_a_jump_until_the_next_waypoint(later_s, people_from):
    with node_in_process("local_planner", lockstep=False, people_from=people_from) as running:
        scan = ("scan",) if people_from == "scan" else ()
        feed(running, START, *scan, "waypoint")
        assert speed(running) > 0.0
        for wait_s in (0.0, 0.05):
            feed(running, later_s + wait_s, *scan)
            assert speed(running) == 0.0
        feed(running, later_s + 0.1, *scan, "waypoint")
        assert speed(running) > 0.0
        running.assert_alive()


def test_people_in_scans_are_tracked_anew_in_a_new_session():
    with node_in_process("local_planner", lockstep=False, people_from="scan") as running:
        for time_s in (START, 0.0):
            feed(running, time_s, "scan")
            tracker = running.work._planner.perception.tracker
            assert len(tracker.identity) > 0
            assert tracker.identity.min() == 0
            assert tracker._time_s == time_s


def episode(start_s):
    return EpisodeStart(episode=0, seed=0, start_area="train", start_s=start_s)


@contextmanager
def driving(kind, **parameters):
    """A node in its first episode."""
    with node_in_process(kind, **parameters) as running:
        running.work.runner._starter.begin(episode(START))
        feed(running, START)
        assert running.work.runner.driving
        yield running


@pytest.mark.parametrize(
    ("kind", "topic"), [("scripted_expert", "intent"), ("strategy", "waypoint")]
)
def test_a_driver_decides_anew_after_a_jump_forward_and_begins_anew_after_one_backward(
    kind, topic, save_model_of
):
    given = {"model": str(save_model_of()), "lockstep": True} if kind == "strategy" else {}
    with driving(kind, **given) as running:

        def stamp():
            return stamp_s(running.sent[topic].header.stamp)

        assert stamp() == START
        feed(running, START + 20.0)
        assert stamp() == START + 20.0
        running.call_timers()
        assert running.published[topic] == 2
        answer = running.sent[topic]
        feed(running, START + 20.0)  # after a pause: the same tick again, and the same answer
        assert running.published[topic] > 2
        assert running.sent[topic] == answer

        feed(running, 10.0)
        runner = running.work.runner
        assert (runner.driving, runner.ready, runner.n_finished) == (False, False, 0)
        runner._starter.begin(episode(12.0))
        feed(running, 12.0)
        assert stamp() == 12.0
        running.assert_alive()


def test_a_strategy_without_resets_waits_for_a_goal_in_a_new_session(save_model_of):
    with node_in_process("strategy", model=str(save_model_of()), reset=False) as running:
        running.call_timers()
        running.work.runner._starter._look.cancel()  # its graph is there
        feed(running, START)
        running.receive("goal_pose", valid_message("goal_pose", START))
        assert running.work.runner.driving
        feed(running, START + 2.0)
        feed(running, 10.0)
        assert not running.work.runner.driving
        running.work.runner._starter._look.cancel()
        running.receive("goal_pose", valid_message("goal_pose", 10.0))
        assert running.work.runner.driving
        assert stamp_s(running.sent["waypoint"].header.stamp) == 10.0
        assert running.work.runner.scenario.goal_area_m[0][1] <= GOAL_M[1]
        running.assert_alive()


def test_a_drive_begins_with_a_new_observation_where_the_last_one_is_old(save_model_of):
    with node_in_process("strategy", model=str(save_model_of()), reset=False) as running:
        running.call_timers()
        running.work.runner._starter._look.cancel()  # its graph is there
        feed(running, START)
        running.wait(0.6)
        running.receive("goal_pose", valid_message("goal_pose", START))
        assert running.work.runner.driving
        assert running.published["waypoint"] == 0
        feed(running, START + 0.65)
        assert stamp_s(running.sent["waypoint"].header.stamp) == pytest.approx(START + 0.65)
        running.assert_alive()


@pytest.mark.parametrize("later_s", [START + 1e6, 0.0])
def test_the_mux_publishes_commands_whatever_the_clock_does(later_s):
    with node_in_process("teleop_mux", use_sim_time=True, stamped_cmd_vel=True) as running:
        for time_s in (START, later_s, later_s + 0.1):
            running.receive("clock", valid_message("clock", time_s))
            running.receive("cmd_vel_teleop", valid_message("cmd_vel", 0.0).twist)
            running.call_timers()
            assert running.sent["cmd_vel_raw"].twist.linear.x > 0.0
            assert stamp_s(running.sent["cmd_vel_raw"].header.stamp) == pytest.approx(time_s)
        running.assert_alive()


def test_a_world_in_lock_step_answers_the_stamp_it_waits_for_and_no_other():
    with node_in_process("hallway_sim", lockstep=True, people=0) as running:
        running.node._begin_episode()
        (now_s,) = [stamp_s(running.sent["clock"].clock)]
        for time_s in (now_s + 5.0, now_s - 5.0 if now_s >= 5.0 else now_s + 9.0):
            running.receive("cmd_vel", to_twist_stamped(Command(0.4, 0.0), time_s))
            assert stamp_s(running.sent["clock"].clock) == now_s
        running.receive("cmd_vel", to_twist_stamped(Command(0.4, 0.0), now_s))
        assert stamp_s(running.sent["clock"].clock) == pytest.approx(now_s + 0.05)
        running.assert_alive()


@pytest.mark.parametrize("later_s", [START + 1.5, START - 1.5])
def test_nav2_drives_after_a_jump_only_to_the_next_waypoint(later_s, nav2_server):
    with node_in_process("nav2_bridge", publish_tf=True) as running:
        feed(running, START, "waypoint")
        goal = nav2_server.answer()
        feed(running, later_s)
        assert goal.canceled
        assert running.work._goals.state == "no goal"
        feed(running, later_s + 0.1, "waypoint")
        nav2_server.answer()
        assert running.work._goals.state == "driving"
        running.assert_alive()


@pytest.mark.parametrize("later_s", [START + 1.5, START - 1.5])
def test_the_guard_stands_the_robot_after_a_jump_until_every_input_has_come(later_s, monkeypatch):
    with node_in_process("guard") as running:

        def command_at(time_s, *topics):
            monkeypatch.setattr(running.node, "now_s", lambda: time_s)
            running.node._guard.advance(time_s)
            for topic in topics:
                running.receive(topic, valid_message(topic, time_s))
            running.node._guard.receive_command(time_s, Command(0.4, 0.0))
            running.node._step()
            return running.sent["cmd_vel"].linear.x

        inputs = ("odom", "robot_pose", "pedestrians", "scan")
        assert command_at(START, *inputs) == pytest.approx(0.4)
        assert command_at(later_s) == 0.0
        assert command_at(later_s + 0.05, *inputs[:3]) == 0.0
        assert command_at(later_s + 0.1, *inputs) == pytest.approx(0.4)
        running.assert_alive()


def test_the_learner_divides_messages_into_sessions_where_the_clock_falls_back(tmp_path):
    with node_in_process("learner", output=str(tmp_path / "model.yaml")) as running:
        sessions = running.work._memory.drive.sessions
        for time_s, n_sessions in ((START, 1), (START + 1e4, 1), (START - 0.5 + 1e4, 1), (0.0, 2)):
            for topic in ("robot_pose", "intent"):
                running.receive(topic, serialize_message(valid_message(topic, time_s)))
            assert len(sessions) == n_sessions
        running.assert_alive()


def test_the_recorder_keeps_the_stamps_of_both_sessions(tmp_path):
    with node_in_process("demo_recorder", output=str(tmp_path / "bag")) as running:
        for time_s in (START, START + 1e4, 0.5):
            for topic in ("clock", "robot_pose"):
                running.receive(topic, serialize_message(valid_message(topic, time_s)))
            assert running.work._recording_clock.now_ns == time_s * 1e9
        running.assert_alive()
