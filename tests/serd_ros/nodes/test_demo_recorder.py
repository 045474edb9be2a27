"""What the recorder reports of a recording."""

import time
from functools import partial

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger

from serd_bag.reader import BagReader
from serd_files.errors import USER_ERRORS
from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import qos
from serd_ros.errors import NodeError
from support.nodes_in_process import node_in_process
from support.waiting import PATIENCE_S, wait_until

POSE = PoseStamped()  # without a stamp


@pytest.fixture
def record(tmp_path):
    """A recorder of some topics into the folder bag."""

    def start(*topics, **more):
        given = {"output": str(tmp_path / "bag"), "topics": [*topics], "minimum_free_mb": 0.0}
        return node_in_process("demo_recorder", **given, **more)

    return start


def test_a_discarded_episode_is_recorded_and_not_counted(record, messages):
    with record("episode") as running:
        for number, outcome in enumerate(("discarded", "timeout")):
            for event, ending in (("start", ""), ("end", outcome)):
                running.receive("episode", messages.mark(10.0 * number, event, number, ending))
        running.call_timers()
        values = values_of(running.sent["diagnostics"], "demo_recorder")
    assert (values["messages"], values["episodes"]) == ("4", "1")


def test_topics_are_recorded_whose_names_match_and_that_are_not_left_out(record, tmp_path):
    with record("/base/.*", without=["/base/raw.*"]) as running:
        make = partial(running.node.create_publisher, String, qos_profile=qos.LATCHED)
        for name in ("/base/name", "/base/raw/name", "/other"):
            make(topic=name).publish(String(data=name))
            wait_until(lambda name=name: running.node.count_publishers(name))
        running.call_timers()
        wait_until(running.work._record_what_waits)
        running.call("stop_recording", Trigger.Request())
    assert {each.topic for each in BagReader(tmp_path / "bag").messages()} == {"/base/name"}
    with pytest.raises(USER_ERRORS, match=r"regular expressions, got '/\(' "), record("/("):
        pass


def test_messages_that_the_middleware_drops_are_counted(record):
    with record("/text:std_msgs/msg/String") as running:
        texts = running.node.create_publisher(String, "/text", qos.STATE)
        wait_until(lambda: running.node.count_publishers("/text"))
        running.call_timers()  # it subscribes
        wait_until(texts.get_subscription_count)
        n_sent = 0
        for count in (1, 2 * qos.STATE_DEPTH):  # the first one is taken before the others come
            for _ in range(count):
                texts.publish(String())
            n_sent += count

            def all_are_known(n_sent=n_sent):
                running.work._record_what_waits()
                running.call_timers()
                return int(running.health["messages"]) + int(running.health["lost"]) == n_sent

            wait_until(all_are_known)
    n_lost = int(running.health["lost"])
    assert n_lost > 0
    assert f"{n_lost} messages of /text were lost on the way" in running.health["message"]


def test_a_clock_beyond_every_stamp_is_rejected_and_the_status_still_published(record):
    with record("/clock") as running:
        for clock in (Time(sec=3), Time(sec=2**31 - 1, nanosec=2**31 - 1)):
            running.receive("clock", serialize_message(Clock(clock=clock)))
        running.call_timers()
        values = values_of(running.sent["diagnostics"], "demo_recorder")
        assert values["messages"] == "1"
        assert "stamp must be from 0 to" in str(running.rejected)


def test_the_clock_of_a_remapped_topic_is_looked_at(record, messages):
    with record("episode", remappings=["/clock:=/robot1/clock"]) as running:
        running.node.create_publisher(Clock, "/robot1/clock", qos.CLOCK)
        wait_until(lambda: running.node.count_publishers("/robot1/clock"))
        running.receive("episode", messages.mark(10.0, "start", 0, ""))
        assert running.work._recording_clock.simulated


def test_of_the_messages_that_wait_at_the_end_one_too_short_for_a_stamp_is_left_out(
    record, tmp_path
):
    with record("odom") as running:
        odometry = running.node.create_publisher(Odometry, "odom", qos.STATE)
        wait_until(odometry.get_subscription_count)
        for message in (bytes([0, 1, 0, 0, 1, 0]), Odometry()):
            odometry.publish(message)
        assert odometry.wait_for_all_acked(Duration(seconds=PATIENCE_S))
    (kept,) = BagReader(tmp_path / "bag").messages()
    assert kept.topic == "/odom"


def test_a_stop_request_keeps_the_messages_that_wait_and_a_start_begins_another_bag(
    record, tmp_path
):
    def ask(name):
        answer = running.call(f"{name}_recording", Trigger.Request())
        return answer.success, answer.message

    with record("odom", record_at_start=False) as running:
        odometry = running.node.create_publisher(Odometry, "odom", qos.STATE)
        wait_until(odometry.get_subscription_count)
        running.receive("odom", serialize_message(Odometry()))
        assert ask("stop") == (False, "nothing is being recorded")
        assert not (tmp_path / "bag").exists()
        for name, n_messages in (("bag", 100), ("bag-2", 1)):
            assert ask("start") == (True, f"recording into {tmp_path / name}")
            assert ask("start") == (False, f"recording into {tmp_path / name}")
            for _ in range(n_messages):
                odometry.publish(Odometry())
            assert odometry.wait_for_all_acked(Duration(seconds=PATIENCE_S))
            assert ask("stop") == (True, f"{n_messages} messages in {tmp_path / name}")
            assert len(list(BagReader(tmp_path / name).messages())) == n_messages


def test_a_pause_leaves_messages_out_and_a_snapshot_has_the_last_seconds_of_all(record, tmp_path):
    def ask(name):
        answer = running.call(name, Trigger.Request())
        return answer.success, answer.message

    with record("odom", "map", record_at_start=False, snapshot_s=PATIENCE_S) as running:
        odometry = running.node.create_publisher(Odometry, "odom", qos.STATE)
        wait_until(odometry.get_subscription_count)
        assert ask("pause_recording") == (False, "nothing is being recorded")
        asked = (None, "start_recording", "pause_recording", "resume_recording")
        for number, name in enumerate(asked):
            if name:
                assert ask(name)[0]
            odometry.publish(Odometry(child_frame_id=str(number)))
            assert odometry.wait_for_all_acked(Duration(seconds=PATIENCE_S))
        snapshots = [tmp_path / f"bag-snapshot-{number}" for number in (1, 2)]
        for folder in snapshots:
            assert ask("save_snapshot") == (True, f"4 messages in {folder}")
        running.call_timers()
        assert running.health["recording"] == "True"
    recorded, kept = BagReader(tmp_path / "bag"), BagReader(snapshots[0])
    data = list(kept.messages())
    assert list(recorded.messages()) == [data[1], data[3]]
    assert recorded.pauses_ns == [(data[1].log_time_ns, data[3].log_time_ns)]
    assert recorded.topics == kept.topics
    with record("odom", record_at_start=False) as running:
        assert ask("save_snapshot")[1].startswith("snapshot_s must be above 0")


def test_messages_without_a_stamp_get_that_of_the_clock_also_when_it_falls_back(record, tmp_path):
    with record("/clock", "robot_pose", "cmd_vel") as running:
        for time_s in (900.0, 5.0):
            clock = Clock(clock=to_stamp(time_s))
            for topic, message in (("clock", clock), ("cmd_vel", Twist()), ("robot_pose", POSE)):
                running.receive(topic, serialize_message(message))
    messages = BagReader(tmp_path / "bag").messages({"/cmd_vel", "/robot_pose"})
    assert [each.log_time_ns for each in messages] == [900 * 10**9] * 2 + [5 * 10**9] * 2


def test_a_topic_that_is_given_twice_is_refused_and_makes_no_folder(record, tmp_path):
    twice = record("odom", "/odom:nav_msgs/msg/Odometry")
    with pytest.raises(USER_ERRORS, match="each topic once, got /odom twice"), twice:
        pass
    assert not (tmp_path / "bag").exists()


def test_log_time_is_the_time_of_receipt_whatever_the_stamps_are(record, tmp_path):
    """Stamps of a faulty sensor: an hour ahead, backwards, and before all time."""
    began_ns, now_s = time.time_ns(), int(time.time())
    with record("odom") as running:
        for sec in (now_s + 3600, now_s, now_s - 100, 0, -1):
            message = Odometry()
            message.header.stamp.sec = sec
            running.receive("odom", serialize_message(message))
    times_ns = [each.log_time_ns for each in BagReader(tmp_path / "bag").messages()]
    assert len(times_ns) == 5
    assert times_ns == sorted(times_ns)
    assert began_ns <= times_ns[0]
    assert times_ns[-1] <= time.time_ns()


def test_a_replay_plays_the_part_that_is_wanted_again_and_again_or_once_and_stays(small_bag):
    given = {"bag": str(small_bag()), "topics": ["robot_pose"], "start_s": 1.0, "duration_s": 0.5}
    for loop, n_played in ((False, 10), (True, 50)):
        with node_in_process("bag_replay", **given, loop=loop, exit_when_done=False) as running:
            running.wait(20.0)  # for subscribers
            for _ in range(6):
                running.call_timers()
                running.wait(10.0)
            assert running.published["robot_pose"] == n_played
            assert not running.node.finished.done()


def test_an_empty_part_of_a_bag_is_rejected_before_playing(small_bag):
    replay = node_in_process("bag_replay", bag=str(small_bag()), start_s=99999.0)
    with (
        pytest.raises(NodeError, match="must hold a message to play, got none from 99999 s"),
        replay,
    ):
        pass
