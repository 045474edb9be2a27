"""What each node does when the clock of its messages jumps forward, jumps backward or stands."""

import pytest

from serd_ros.convert.stamp import Jump, StampClock, stamp_s
from serd_sim.episodes.episode import EpisodeStart
from support.nodes_in_process import node_in_process
from support.valid_messages import GOAL_M, valid_message
from support.waiting import wait_until

SECOND_NS = 1_000_000_000
OBSERVATION = ("pedestrians", "odom", "robot_pose")
START = 100.0


def feed(running, time_s, *topics):
    """The messages of these topics, then the subscribed ones of an observation, all at one time."""
    for topic in (*topics, *filter(running.subscriptions, OBSERVATION)):
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


@pytest.mark.parametrize("later_s", [START + 1.5, START - 1.5, 0.0])
def test_the_planner_stands_after_a_jump_until_the_next_waypoint(later_s):
    with node_in_process("local_planner", lockstep=False) as running:
        feed(running, START, "waypoint")
        assert speed(running) > 0.0
        for wait_s in (0.0, 0.05):
            feed(running, later_s + wait_s)
            assert speed(running) == 0.0
        feed(running, later_s + 0.1, "waypoint")
        assert speed(running) > 0.0
        running.assert_alive()


def episode(start_s):
    return EpisodeStart(episode=0, seed=0, start_area="train", start_s=start_s)


@pytest.mark.parametrize(
    ("kind", "topic"), [("scripted_expert", "intent"), ("strategy", "waypoint")]
)
def test_a_driver_decides_anew_after_a_jump_forward_and_begins_anew_after_one_backward(
    kind, topic, save_model_of
):
    given = {"model": str(save_model_of()), "lockstep": True} if kind == "strategy" else {}
    with node_in_process(kind, **given) as running:

        def stamp():
            return stamp_s(running.sent[topic].header.stamp)

        runner = running.work.runner
        runner._starter.begin(episode(START))
        feed(running, START)
        assert runner.driving
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
        assert (runner.driving, runner.ready, runner.n_finished) == (False, False, 0)
        runner._starter.begin(episode(12.0))
        feed(running, 12.0)
        assert stamp() == 12.0
        running.assert_alive()


def test_a_strategy_without_resets_waits_for_a_goal_in_a_new_session(save_model_of):
    with node_in_process("strategy", model=str(save_model_of()), reset=False) as running:
        runner = running.work.runner
        running.call_timers()
        for time_s in (START, 10.0):
            feed(running, time_s)
            assert not runner.driving
            runner._starter._look.cancel()  # its graph is there
            running.receive("goal_pose", valid_message("goal_pose", time_s))
            wait_until(lambda: running.call_timers() or runner.driving)  # planned in a thread
            feed(running, time_s + 2.0)
            assert time_s <= stamp_s(running.sent["waypoint"].header.stamp) <= time_s + 2.0
        assert runner.scenario.goal_area_m[0][1] <= GOAL_M[1]
        running.assert_alive()
