"""What each node does when the clock of its messages jumps forward, jumps backward or stands."""

from contextlib import contextmanager

import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import Bool

from serd_app.teleop.page.requests import Away, EmergencyStop, Episode, Hold, Move
from serd_core.grid.grid import Action
from serd_ros.convert.command import to_twist_stamped
from serd_ros.convert.diagnostics import to_diagnostics
from serd_ros.convert.stamp import Jump, StampClock, stamp_s
from serd_sim.episodes.result import EpisodeStart
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
    ],
)
def test_a_jump_is_a_step_of_more_than_a_second(steps_ns, jump):
    clock = StampClock()
    assert clock.advance(steps_ns[0]) is Jump.NONE
    assert clock.advance(steps_ns[1]) is jump


def test_a_late_stamp_does_not_move_the_clock_back():
    clock = StampClock()
    for time_ns, jump in ((10, Jump.NONE), (4, Jump.LATE), (9, Jump.LATE), (10, Jump.NONE)):
        assert clock.advance(time_ns) is jump


@pytest.mark.parametrize("later_s", [START + 1.5, START + 1000.0, START - 1.5, 0.0])
@pytest.mark.parametrize("people_from", ["given", "scan"])
def test_the_planner_stands_after_a_jump_until_the_next_waypoint(later_s, people_from):
    with node_in_process("local_planner", lockstep=False, people_from=people_from) as running:
        scan = ("scan",) if people_from == "scan" else ()
        feed(running, START, *scan, "waypoint")
        assert speed(running) > 0.0
        feed(running, later_s, *scan)
        assert speed(running) == 0.0
        feed(running, later_s + 0.05, *scan)
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


@pytest.mark.parametrize("kind", ["scripted_expert", "strategy"])
def test_a_driver_decides_on_what_it_sees_after_a_jump_forward_and_after_a_pause(
    kind, save_model_of
):
    given = {"model": str(save_model_of()), "lockstep": True} if kind == "strategy" else {}
    topic = "waypoint" if kind == "strategy" else "intent"
    with driving(kind, **given) as running:
        assert stamp_s(running.sent[topic].header.stamp) == START
        feed(running, START + 20.0)
        assert stamp_s(running.sent[topic].header.stamp) == START + 20.0
        running.call_timers()
        assert running.published[topic] == 2
        answer = running.sent[topic]
        feed(running, START + 20.0)  # after a pause: the same tick again, and the same answer
        assert running.published[topic] > 2
        assert running.sent[topic] == answer
        assert running.work.runner.driving
        running.assert_alive()


@pytest.mark.parametrize("kind", ["scripted_expert", "strategy"])
def test_a_driver_begins_anew_after_a_jump_backward(kind, save_model_of):
    parameters = {"model": str(save_model_of())} if kind == "strategy" else {}
    topic = "waypoint" if kind == "strategy" else "intent"
    with driving(kind, **parameters) as running:
        feed(running, 10.0)
        assert not running.work.runner.driving
        assert not running.work.runner.ready
        assert running.work.runner.n_finished == 0
        running.work.runner._starter.begin(episode(12.0))
        feed(running, 12.0)
        assert stamp_s(running.sent[topic].header.stamp) == 12.0
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


@contextmanager
def hand_driver():
    """A page with a person who drives north, in an episode."""
    with node_in_process("teleop_page", port=0) as running:
        node = running.node
        node.attend = lambda: True
        running.call_timers()
        node.episodes.session.start()
        node.episodes._starter.begin(episode(START))
        press(node.choice, Action.NORTH)
        feed(running, START)
        assert running.sent["intent"].vector.y == 1.0
        yield running


def press(choice, action):
    """Press a key anew, and hold it."""
    for held in (None, action):
        choice.hold(held)


def test_a_front_end_stops_after_a_jump_forward_and_keeps_its_episode():
    with hand_driver() as running:
        feed(running, START + 5.0)
        assert running.sent["intent"].vector.y == 0.0
        assert running.node.choice.action is Action.WAIT
        assert running.node.episodes.is_running
        press(running.node.choice, Action.EAST)
        feed(running, START + 6.0)
        assert running.sent["intent"].vector.x == 1.0
        running.assert_alive()


@pytest.mark.parametrize("silent", ["mux", "world"])
def test_a_held_key_counts_anew_after_mux_or_world_were_silent(silent):
    with hand_driver() as running:
        node = running.node
        for tick in range(1, 41):
            running.wait(0.05)
            if silent == "world" or tick in (1, 40):
                running.receive("diagnostics", mux_state(active="planner"))
            if silent == "mux" or tick in (1, 40):
                feed(running, START + 0.05 * tick)
            running.call_timers()
            if tick < 20:
                assert running.sent["intent"].vector.y == 1.0
                assert not running.sent["driver_gone"].data
        assert running.sent["intent"].vector.y == 0.0
        assert running.sent["driver_gone"].data or not node._is_silent
        assert node.choice.action is Action.WAIT
        running.assert_alive()


def test_a_key_pressed_in_the_e_stop_drives_neither_before_the_mux_confirms_it_nor_after_it():
    with hand_driver() as running:
        node, choice = running.node, running.node.choice

        def feed_until(before_s, after_s):
            for tick in range(round(before_s / 0.25) + 1, round(after_s / 0.25) + 1):
                feed(running, START + 0.25 * tick)

        node.set_e_stop(True)
        press(choice, Action.NORTH)
        feed_until(0.0, 2.0)
        assert running.sent["intent"].vector.y == 0.0
        running.receive("e_stop_engaged", Bool(data=True))
        press(choice, Action.NORTH)
        node.set_e_stop(False)
        feed_until(2.0, 4.0)
        running.receive("e_stop_engaged", Bool(data=False))
        feed_until(4.0, 6.0)
        assert running.sent["intent"].vector.y == 0.0
        assert running.sent["driver_gone"].data
        press(choice, Action.NORTH)
        feed_until(6.0, 8.0)
        assert running.sent["intent"].vector.y == 1.0
        running.assert_alive()


@pytest.mark.parametrize("silent_s", [0.45, 0.55])
def test_a_held_key_moves_on_only_after_a_pause_of_the_page_in_which_the_mux_did_not_stop(
    silent_s, monkeypatch
):
    """The mux stops the robot after 0.5 s; the page's next request may be taken at once after."""
    requests = []
    with node_in_process("teleop_page", port=0) as running:
        node = running.node
        monkeypatch.setattr(node._server, "take", lambda: [requests.pop(0)] if requests else [])

        def beat(after_s, *linear):
            running.wait(after_s)
            requests.extend(Move(type="move", linear=each, angular=0.0) for each in linear)
            running.call_timers()

        node.set_mode("velocity")
        beat(0.0, 0.0)
        beat(0.1, 1.0)
        assert running.sent["cmd_vel_teleop"].linear.x > 0.0
        beat(0.2)
        driven = running.published["cmd_vel_teleop"]
        beat(silent_s - 0.2, 1.0)
        drives_on = running.published["cmd_vel_teleop"] > driven
        drives_on &= running.sent["cmd_vel_teleop"].linear.x > 0.0
        assert drives_on == (silent_s < 0.5)
        beat(0.1, 0.0)
        beat(0.1, 1.0)
        assert running.sent["cmd_vel_teleop"].linear.x > 0.0
        running.assert_alive()


def test_a_key_that_is_held_while_an_episode_begins_is_its_first_decision():
    with node_in_process("teleop_page", port=0) as running:
        node = running.node
        node.attend = lambda: True
        running.call_timers()
        node.episodes.session.start()
        press(node.choice, Action.NORTH)
        for tick in range(10):
            feed(running, START + 0.5 * tick)
        assert running.published["intent"] == 0
        node.episodes._starter.begin(episode(START + 10.0))
        feed(running, START + 4.75)
        assert running.published["intent"] == 0
        feed(running, START + 10.0)
        assert (node.episodes.n_decisions, running.sent["intent"].vector.y) == (1, 1.0)
        assert stamp_s(running.sent["intent"].header.stamp) == START + 10.0
        running.assert_alive()


def test_keys_count_again_after_the_stop_was_pressed_twice_and_released_by_another():
    with hand_driver() as running:
        node, choice = running.node, running.node.choice
        node.set_e_stop(True)
        running.receive("e_stop_engaged", Bool(data=True))
        node.set_e_stop(True)
        running.receive("e_stop_engaged", Bool(data=False))
        press(choice, Action.NORTH)
        for tick in range(1, 9):
            feed(running, START + 0.25 * tick)
        assert running.sent["intent"].vector.y == 1.0


PAGE_REQUESTS = {
    "hold": Hold(type="hold", direction="north"),
    "let go": Hold(type="hold", direction=None),
    "discard": Episode(type="episode", do="discard"),
    "save": Episode(type="episode", do="save"),
    "stop": EmergencyStop(type="e_stop", engaged=True),
    "release": EmergencyStop(type="e_stop", engaged=False),
    "lose the connection": Away(type="away"),
}


@contextmanager
def person_at_page(monkeypatch):
    """A page in an episode, and a function by which its person acts for some beats."""
    requests, ticks = [], iter(range(1, 1000))
    with node_in_process("teleop_page", port=0) as running:
        running.call_timers()
        monkeypatch.setattr(
            running.node._server, "take", lambda: [requests.pop(0)] if requests else []
        )
        running.node.episodes.session.start()
        running.node.episodes._starter.begin(episode(START))

        def act(deed, n_beats=1, planner="planner"):
            for _ in range(n_beats):
                requests.append(PAGE_REQUESTS[deed])
                running.wait(0.05)
                running.call_timers()
                running.receive("diagnostics", mux_state(active=planner))
                feed(running, START + 0.05 * next(ticks))
            return running.sent["intent"].vector.y if "intent" in running.sent else 0.0

        yield running, act


@pytest.mark.parametrize(
    "event", ["e-stop", "discard", "save", "planner restarts", "lose the connection"]
)
def test_a_key_that_is_held_all_the_time_drives_again_only_when_it_is_pressed_anew(
    event, monkeypatch
):
    n_beats = 45
    with person_at_page(monkeypatch) as (running, act):
        act("let go", 16)
        assert act("hold", n_beats) == 1.0
        if event == "e-stop":
            act("stop")
            running.receive("e_stop_engaged", Bool(data=True))
            assert act("hold", n_beats) == 0.0
            act("release")
            running.receive("e_stop_engaged", Bool(data=False))
        elif event == "planner restarts":
            act("hold", 15, planner="")
        else:
            act(event)
        driven = running.published["intent"]
        for _ in range(2 * n_beats):
            assert act("hold") == 0.0
        assert running.sent["driver_gone"].data
        assert running.published["intent"] <= driven + 5  # to wait, once a second
        act("let go", 16)
        assert act("hold", n_beats) == 1.0
        assert not running.sent["driver_gone"].data
        running.assert_alive()


def mux_state(**values):
    return to_diagnostics("teleop_mux", START, values)


def test_a_front_end_begins_a_new_session_after_a_jump_backward():
    with hand_driver() as running:
        running.receive("episode", valid_message("episode", START))
        assert running.node.episodes.other_driver
        feed(running, 10.0)
        assert running.sent["intent"].vector.y == 0.0
        assert running.node.episodes.session.phase == "idle"
        assert running.node.episodes.tally.running is None
        assert running.node.episodes.n_decisions == 0
        running.node.episodes.session.start()
        running.assert_alive()


@pytest.mark.parametrize("later_s", [START + 1e6, 0.0])
def test_the_mux_publishes_commands_whatever_the_clock_does(later_s):
    with node_in_process("teleop_mux", use_sim_time=True, stamped_cmd_vel=True) as running:
        for time_s in (START, later_s, later_s + 0.1):
            running.receive("clock", valid_message("clock", time_s))
            running.receive("cmd_vel_teleop", to_command())
            running.call_timers()
            assert running.sent["cmd_vel_raw"].twist.linear.x > 0.0
            assert stamp_s(running.sent["cmd_vel_raw"].header.stamp) == pytest.approx(time_s)
        running.assert_alive()


def to_command():
    return to_twist_stamped(Command(0.4, 0.0), 0.0).twist


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
