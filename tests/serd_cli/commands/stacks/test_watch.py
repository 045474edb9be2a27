"""`serd watch BAG`: what the page shows at each time of a recording."""

import asyncio
import json
import math
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from aiohttp import ClientSession
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message

from serd_app.teleop.page.requests import Hold, Replay
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_cli.errors import UsageError
from serd_cli.watch import BagWatch, layers_of
from serd_sim.scenario.scenario import load_scenario
from support.processes import read_json_object
from support.waiting import PATIENCE_S

#: The robot of drive_bag is at y = 1.5 m + 0.5 m/s t; the recording begins with the episode.
START_Y_M, SPEED_MPS, LENGTH_S, DECISION_S = 1.5, 0.5, 10.0, 2.0


@pytest.fixture
def watch(drive_bag):
    return BagWatch(drive_bag(), load_scenario("hallway"))


def replay(**change):
    return Replay(type="replay", **change)


def y_m(state):
    return state["world"]["robot"][1]


def test_the_robot_is_where_it_was_recorded_as_time_goes_on(watch):
    watch.state(50.0)
    state = watch.state(54.05)
    assert state["replay"] == {"at_s": 4.05, "rate": 1.0, "playing": True}
    assert y_m(state) == pytest.approx(START_Y_M + SPEED_MPS * 4.0)
    assert state["action"] == "north"
    assert state["waypoint"] is not None
    assert (state["episode"]["phase"], state["episode"]["number"]) == ("running", 0)
    assert state["episode"]["duration_s"] == pytest.approx(4.0)
    assert state["episode"]["decisions"] == 3


def test_the_time_line_has_the_length_and_the_episodes(watch):
    assert watch.duration_s == pytest.approx(LENGTH_S)
    assert watch.replay["episodes"] == [[0.0, pytest.approx(LENGTH_S), "arrived"]]


def test_going_to_a_time_forward_and_back_shows_it_at_once(watch):
    watch.state(0.0)
    for at_s in (8.0, 2.0, 5.0, 7.9):
        watch.apply_request(replay(at_s=at_s), 1.0)
        state = watch.state(1.0)
        n_decisions = math.floor(at_s / DECISION_S + 1e-9) + 1
        assert (state["action"], state["episode"]["decisions"]) == ("north", n_decisions)
        assert state["waypoint"] == [4.5, 1.5 + n_decisions]
        assert y_m(state) == pytest.approx(START_Y_M + SPEED_MPS * at_s)
        assert state["episode"]["phase"] == "running"
        assert state["replay"]["at_s"] == at_s


def test_a_time_beyond_the_end_is_the_end(watch):
    watch.apply_request(replay(at_s=1000.0), 0.0)
    state = watch.state(0.0)
    assert y_m(state) == pytest.approx(START_Y_M + SPEED_MPS * LENGTH_S)
    assert (state["episode"]["phase"], state["episode"]["arrived"]) == ("ended", 1)
    assert not state["replay"]["playing"]


def test_paused_time_stands_also_after_going_to_another(watch):
    watch.state(0.0)
    watch.apply_request(replay(playing=False), 2.0)
    assert watch.state(60.0)["replay"] == {"at_s": 2.0, "rate": 1.0, "playing": False}
    watch.apply_request(replay(at_s=6.0), 60.0)
    assert watch.state(90.0)["replay"]["playing"] is False
    assert y_m(watch.state(90.0)) == pytest.approx(START_Y_M + SPEED_MPS * 6.0)
    watch.apply_request(replay(playing=True), 90.0)
    assert watch.state(91.0)["replay"]["at_s"] == 7.0


def test_the_rate_changes_from_now_on(watch):
    watch.state(0.0)
    watch.apply_request(replay(rate=4.0), 1.0)
    assert watch.state(2.0)["replay"] == {"at_s": 5.0, "rate": 4.0, "playing": True}


def test_requests_of_a_driver_have_no_effect(watch):
    before = watch.state(0.0)
    watch.apply_request(Hold(type="hold", direction="east"), 0.0)
    assert watch.state(0.0) == before | {"world": before["world"]}


def test_a_damaged_recording_is_shown_as_far_as_it_is_readable(drive_bag):
    bag = drive_bag()
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    watch = BagWatch(bag, load_scenario("hallway"))
    assert 0.0 < watch.duration_s < LENGTH_S
    watch.state(0.0)
    assert y_m(watch.state(1.05)) == pytest.approx(START_Y_M + SPEED_MPS * 1.0)


@pytest.mark.parametrize("topic", ["/robot_pose", "/intent", "/episode"])
def test_a_cut_message_is_left_out(drive_bag, tmp_path, topic):
    reader, left = BagReader(drive_bag()), None
    with BagWriter(tmp_path / "cut") as writer:
        for each in reader.topics.values():
            writer.add_topic(each.name, each.type_name)
        for message in reader.messages():
            is_first = left is None and message.topic == topic
            left = message if is_first else left
            data = message.data[:20] if is_first else message.data
            writer.write(message.topic, data, message.log_time_ns)
    watch = BagWatch(tmp_path / "cut", load_scenario("hallway"))
    assert len(watch.replay["episodes"]) == (topic != "/episode")
    watch.state(0.0)
    assert y_m(watch.state(4.05)) == pytest.approx(START_Y_M + SPEED_MPS * 4.0)


def test_a_recording_without_poses_is_refused_by_name(drive_bag, tmp_path):
    with BagWriter(tmp_path / "without") as writer:
        for topic in BagReader(drive_bag()).topics.values():
            if topic.name != "/robot_pose":
                writer.add_topic(topic.name, topic.type_name)
    with pytest.raises(UsageError, match="must hold robot_pose as geometry_msgs/msg/PoseStamped"):
        BagWatch(tmp_path / "without", load_scenario("hallway"))


@pytest.fixture
def two_robots(drive_bag, tmp_path):
    """The bag's robot in two namespaces, the second 1 m to the east."""
    bags = {"robot1": drive_bag("first"), "robot2": drive_bag("second", x_m=5.5)}
    messages = []
    with BagWriter(tmp_path / "both") as writer:
        for robot, bag in bags.items():
            for topic in BagReader(bag).topics.values():
                writer.add_topic(f"/{robot}{topic.name}", topic.type_name)
            messages += [
                each._replace(topic=f"/{robot}{each.topic}") for each in BagReader(bag).messages()
            ]
        for each in sorted(messages, key=lambda each: each.log_time_ns):
            writer.write(each.topic, each.data, each.log_time_ns)
    return tmp_path / "both"


def test_one_of_two_robots_is_shown_by_its_namespace(two_robots):
    for namespace, x_m in (("robot1", 4.5), ("/robot2", 5.5)):
        watch = BagWatch(two_robots, load_scenario("hallway"), namespace=namespace)
        watch.state(0.0)
        assert watch.state(1.05)["world"]["robot"][0] == pytest.approx(x_m)


def test_robots_of_several_namespaces_are_refused_by_name(two_robots):
    with pytest.raises(
        UsageError, match="/robot1/intent, /robot2/intent; choose one, as by --namespace /robot1/"
    ):
        BagWatch(two_robots, load_scenario("hallway"))


def test_odometry_of_prefixed_frames_is_shown_where_the_prefix_is_given(drive_bag, tmp_path):
    reader, odometry = BagReader(drive_bag()), Odometry()
    odometry.header.frame_id, odometry.child_frame_id = "robot1/odom", "robot1/base_link"
    odometry.twist.twist.linear.x = SPEED_MPS
    with BagWriter(tmp_path / "prefixed") as writer:
        writer.add_topic("/odom", "nav_msgs/msg/Odometry")
        for each in reader.topics.values():
            writer.add_topic(each.name, each.type_name)
        for each in reader.messages():
            writer.write("/odom", serialize_message(odometry), each.log_time_ns)
            writer.write(each.topic, each.data, each.log_time_ns)
    for frame_prefix, speed_mps in (("", 0.0), ("robot1/", SPEED_MPS)):
        scenario = load_scenario("hallway")
        watch = BagWatch(tmp_path / "prefixed", scenario, frame_prefix=frame_prefix)
        watch.state(0.0)
        assert watch.state(1.05)["world"]["robot"][3] == speed_mps


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nowhere"], "nowhere"),
        (["--rate", "2"], "--rate must be left out without a BAG, got 2"),
        (["--scenario", "hallwy"], "did you mean 'hallway'?"),
        (["--address", "0.0.0.0"], "unless a token is given"),
        (["--namespace", "1"], "namespace must be letters"),
        (["--model", "model.yaml"], "--model must be left out without a BAG, got model.yaml"),
        (["bag", "--model", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_what_cannot_be_watched_is_refused(serd, arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bag").mkdir()
    ended = serd("watch", *arguments)
    assert ended.code == 2
    assert sentence in ended.err


@contextmanager
def watching(*words):
    """The command; Ctrl-C ends it."""
    program = "import sys; from serd_cli.main import main; sys.exit(main())"
    with subprocess.Popen(
        [sys.executable, "-c", program, "watch", *map(str, words), "--port", "0", "--json"],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process
        process.send_signal(signal.SIGINT)
    assert process.returncode == 0


def test_the_address_is_printed_as_json_and_ctrl_c_is_the_usual_end(drive_bag):
    with watching(drive_bag()) as process:
        assert read_json_object(process.stdout)["url"].startswith("http://127.0.0.1:")


async def first_of(url, kind):
    """The first message of a kind that the page receives."""
    async with ClientSession() as session:
        origin = {"Origin": url.rstrip("/")}
        async with session.ws_connect(f"{url}socket", headers=origin) as socket:
            async for message in socket:
                values = json.loads(message.data)
                if values["type"] == kind:
                    return values
    raise AssertionError("the page's server ended")


def test_a_recording_has_the_layers_of_a_model_on_the_cells_of_its_scenario(
    drive_bag, save_model_of
):
    model, place = save_model_of("crossing"), load_scenario("crossing")
    with watching(drive_bag(), "--model", model) as process:
        url = read_json_object(process.stdout)["url"]
        layers = asyncio.run(asyncio.wait_for(first_of(url, "overlay"), PATIENCE_S))
        scene = asyncio.run(asyncio.wait_for(first_of(url, "scene"), PATIENCE_S))
    assert scene["name"] == "crossing"
    assert layers == json.loads(json.dumps(layers_of(model, place)))
    assert len(layers["policy"]["directions"]) == len(scene["cells_m"])
    assert [0, 1] in layers["policy"]["directions"]
    assert "with flow 90 %" in layers["dynamics"]["note"]


def test_a_model_of_another_grid_than_that_of_the_scenario_is_refused(
    serd, drive_bag, save_model_of
):
    model = save_model_of("crossing", name="other.yaml")
    ended = serd("watch", drive_bag(), "--model", model, "--scenario", "hallway")
    assert ended.code == 2
    assert "other.yaml" in ended.err
