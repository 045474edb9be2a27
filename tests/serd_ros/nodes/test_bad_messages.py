"""A message that breaks a rule is dropped and counted, and the node goes on."""

import json
import math
import re
from collections import Counter
from functools import reduce

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import SetBool

from serd_bag.errors import FileError
from serd_ros.convert.diagnostics import values_of
from serd_ros.nodes.watch_page import episode_values
from support.nodes_in_process import node_in_process
from support.valid_messages import valid_message

PARAMETERS = {
    "hallway_sim": {"people": 0},
    "teleop_page": {"port": 0},
    "teleop_mux": {"use_sim_time": True},
}


def part_of(whole, name):
    return whole[int(name)] if name.isdigit() else getattr(whole, name)


def setting(path, value):
    """Sets a field of a message, or what a function makes of it."""
    *parts, name = path.split(".")

    def change(message):
        owner = reduce(part_of, parts, message)
        setattr(owner, name, value(getattr(owner, name)) if callable(value) else value)

    return change


def with_another_number_of_rays(message):
    message.ranges = message.ranges[:-7]
    message.angle_max -= 7 * message.angle_increment


def with_first_x(*raw):
    return setting("data", lambda data: type(data)("B", raw) + data[4:])


NAN_X = setting("pose.position.x", math.nan)
WITHOUT_KEYS = setting("status.0.values", [])
CASES = {
    "teleop_page": [
        ("episode", WITHOUT_KEYS, "values must have the key episode, got none"),
        ("episode", setting("status.0.values.0.value", "x"), "episode must be a number, got 'x'"),
        ("episode", setting("status", []), "status must have one named 'episode', got none"),
        ("waypoint", NAN_X, "position must be finite and at most 1e+06, got nan"),
        ("scan", with_another_number_of_rays, "must have the 360 rays"),
        ("robot_pose", setting("header.stamp.sec", -5), "stamp must be from 0 to"),
    ],
    "local_planner": [
        ("intent", setting("vector.y", math.nan), "vector must be finite"),
        ("waypoint", setting("header.frame_id", "odom"), "joined with it by /tf, got"),
    ],
    "scripted_expert": [
        ("pedestrians", setting("data", bytes(25)), "data must be one row of width * point_step"),
        ("pedestrians", setting("fields", lambda fields: fields[:3]), "must have the fields x, y,"),
        ("pedestrians", with_first_x(0, 0, 192, 127), "x must be finite"),
        ("pedestrians", with_first_x(1, 0, 160, 127), "x must be finite"),  # a signalling NaN
        ("diagnostics", WITHOUT_KEYS, "values must have the key robot_on_person"),
    ],
    "hallway_sim": [
        ("goal_area", setting("polygon.points", []), "three corners of a polygon without crossing"),
        ("goal_area", setting("polygon.points.0.x", 99.0), "a polygon without crossing edges"),
    ],
}


@pytest.mark.parametrize("kind", CASES)
def test_a_bad_message_is_dropped_and_counted_and_the_next_one_is_taken(kind):
    with node_in_process(kind, **PARAMETERS.get(kind, {})) as running:
        running.call_timers()  # a live world begins, and reports
        n_dropped = Counter()
        for number, (topic, break_rule, words) in enumerate(CASES[kind]):
            bad = valid_message(topic, 10.0 + number)
            break_rule(bad)
            n_dropped[topic] += 2
            for _ in range(2):
                running.receive(topic, bad)
            running.call_timers()
            reason = running.rejected[f"rejected.{topic}"]
            assert words in reason
            assert sum(map(int, re.findall(r"(\d+) x ", reason))) == n_dropped[topic]
            reported = values_of(running.sent["diagnostics"], f"{kind}: input")
            assert reported["internal_errors"] == "0"
            assert reported[f"rejected.{topic}"] == reason
            n_rejected = running.node.callbacks.n_rejected
            running.receive(topic, valid_message(topic, 10.05 + number))
            assert running.node.callbacks.n_rejected == n_rejected
        running.assert_alive()


def test_the_state_of_the_page_is_json_after_messages_with_nan():
    with node_in_process("teleop_page", port=0) as running:
        for topic in ("pedestrians", "odom", "robot_pose", "waypoint", "scan"):
            running.receive(topic, valid_message(topic, 10.0))
        scan = valid_message("scan", 10.05)
        scan.ranges[5] = math.nan
        running.receive("scan", scan)
        for topic in ("robot_pose", "waypoint"):
            bad = valid_message(topic, 10.05)
            NAN_X(bad)
            running.receive(topic, bad)
        node = running.node
        state = node._view.state(node.observation, episode_values(node.episodes), node.wall_s())
        assert json.loads(json.dumps(state, allow_nan=False))["waypoint"] == [3.5, 7.5]
        running.call_timers()
        running.assert_alive()


def test_an_error_in_a_callback_is_counted_logged_and_ends_nothing():
    with node_in_process("teleop_mux") as running:
        running.node._mux = None
        for _ in range(2):
            running.receive("e_stop", valid_message("e_stop", 0.0))
        assert running.node.callbacks.n_internal_errors == 2
        running.node._report_input()
        status = running.sent["diagnostics"].status[0]
        assert (status.level, status.name) == (DiagnosticStatus.ERROR, "teleop_mux: input")
        assert not running.node.finished.done()
        response = running.call("set_e_stop", SetBool.Request(data=True))
        assert not response.success
        assert "'NoneType' object has no attribute" in response.message


def test_a_timer_that_fails_ten_times_in_a_row_ends_the_node(capsys):
    with node_in_process("teleop_mux") as running:
        mux = running.node._mux
        for failures in (9, 9, 10):
            running.node._mux = None
            for _ in range(failures):
                assert not running.node.finished.done()
                running.call_timers()
            running.node._mux = mux
            if failures < 10:
                running.call_timers()
        assert running.node.finished.result() == 2
    assert "step failed 10 times in a row" in capsys.readouterr().err


def test_a_full_disk_ends_the_node_with_its_sentence_and_no_traceback(capsys):
    def fail(*_):
        raise FileError("the disk is full; free some space")

    with node_in_process("teleop_mux") as running:
        running.node._mux.step = fail
        running.call_timers()
        assert running.node.finished.result() == 2
        running.receive("e_stop", valid_message("e_stop", 0.0))
    assert capsys.readouterr().err == "teleop_mux: the disk is full; free some space\n"
