"""The first page about a recording: what it shows, and what is missing, without a model."""

import json
import re
import shlex

import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from serd_app.report.look import look
from serd_app.report.look_page import look_page
from serd_bag.errors import FileError
from support.commands import run_serd

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = {name.rsplit("/", 1)[-1]: kind for name, kind in STORE.types.items()}
#: A room of 6 by 4 m with the robot's first place in its middle, and the mounting of the lidar.
HALF_M = np.array([3.0, 2.0])
AHEAD_M = 0.2
HZ, N = 10, 240


def pose_at(n):
    """A robot that drives east for 8 s at 0.25 m/s, stands 12 s, and drives back."""
    time_s = n / HZ
    return min(time_s, 8.0) * 0.25 - max(time_s - 20.0, 0.0) * 0.25


def ranges_at(x_m, angles):
    """Distances to the walls from the lidar, which is mounted ahead."""
    at = np.array([x_m + AHEAD_M, 0.0])
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    with np.errstate(divide="ignore"):
        reach = np.where(ways > 0, (HALF_M - at) / ways, (-HALF_M - at) / ways)
    return np.abs(reach).min(axis=1).astype(np.float32)


def write_bag(path, *, scans=True):
    header = lambda n, frame: TYPE["Header"](  # noqa: E731
        stamp=TYPE["Time"](sec=1000 + n // HZ, nanosec=n % HZ * 10**8), frame_id=frame
    )
    quaternion = TYPE["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    point, vector = TYPE["Point"], TYPE["Vector3"]
    angles = np.linspace(-np.pi, np.pi, 181)[:-1]
    with Writer(path, version=9) as bag:

        def add(topic, kind):
            name = next(each for each in STORE.types if each.endswith(f"/msg/{kind}"))
            return bag.add_connection(topic, name, typestore=STORE), name

        odom, twist = add("/odom", "Odometry"), add("/cmd_vel", "Twist")
        scan, fixed = add("/scan", "LaserScan"), add("/tf_static", "TFMessage")

        def put(connection, n, message):
            data = STORE.serialize_cdr(message, connection[1])
            bag.write(connection[0], (1000 * HZ + n) * 10**8, data)

        mounted = TYPE["TransformStamped"](
            header=header(0, "base_link"), child_frame_id="laser",
            transform=TYPE["Transform"](vector(x=AHEAD_M, y=0.0, z=0.0), quaternion),
        )  # fmt: skip
        put(fixed, 0, TYPE["TFMessage"]([mounted]))
        for n in range(N):
            pose = TYPE["Pose"](point(x=pose_at(n), y=0.0, z=0.0), quaternion)
            speed = (pose_at(n + 1) - pose_at(n)) * HZ
            none = vector(x=0.0, y=0.0, z=0.0)
            sent = TYPE["Twist"](linear=vector(x=speed, y=0.0, z=0.0), angular=none)
            put(odom, n, TYPE["Odometry"](
                header=header(n, "odom"), child_frame_id="base_link",
                pose=TYPE["PoseWithCovariance"](pose, np.zeros(36)),
                twist=TYPE["TwistWithCovariance"](sent, np.zeros(36)),
            ))  # fmt: skip
            put(twist, n, sent)
            seen = ranges_at(pose_at(n), angles)
            seen[::7] = np.inf
            seen[3::7] = 0.0
            if scans:
                put(scan, n, TYPE["LaserScan"](
                    header=header(n, "laser"), angle_min=-np.pi, angle_max=np.pi,
                    angle_increment=2 * np.pi / 180, time_increment=0.0, scan_time=0.1,
                    range_min=0.1, range_max=20.0, ranges=seen, intensities=np.zeros(0, np.float32),
                ))  # fmt: skip
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp("look") / "bag")


def test_the_map_of_scans_has_the_walls_of_the_room_and_free_space_between(bag):
    place = look(bag).place
    rows, columns = np.nonzero(place.log_odds > 1.0)
    walls = np.array(place.origin_m) + place.cell_m * (np.column_stack([columns, rows]) + 0.5)
    away = np.abs(np.abs(walls) - HALF_M).min(axis=1)
    assert len(walls) > 120
    assert away.max() < 1.5 * place.cell_m
    inside = np.argwhere(place.log_odds < -1.0)[:, ::-1]
    free = np.array(place.origin_m) + place.cell_m * (inside + 0.5)
    assert (np.abs(free) < HALF_M).all()
    assert len(free) * place.cell_m**2 > 0.8 * 4 * HALF_M.prod()


def test_drives_are_listed_with_why_they_end_and_moves_are_counted(bag):
    found = look(bag)
    first, last = found.drives
    assert first.ends == "a stop"
    assert first.way_m == pytest.approx(2.0, abs=0.1)
    assert last.ends == "the end of the recording"
    assert sum(found.outcomes.values()) == found.outcomes["forward"] > 3
    assert found.mapping.action_topic == "/cmd_vel"
    assert found.enough.startswith("2 drives of")
    missing = int(re.search(r"; (\d+) more", found.enough)[1])
    assert 3 <= 2 + missing <= 10


def test_the_next_command_names_the_mapping_that_was_given(tmp_path):
    table, mapping = tmp_path / "laps.csv", tmp_path / "of mine.yaml"
    table.write_text("when,x,y\n" + "".join(f"{0.1 * n:.1f},{0.1 * n},0\n" for n in range(60)))
    mapping.write_text("{time: when}")
    (command,) = look(table, mapping).next_commands()
    assert shlex.split(command)[2:] == [str(table), "--mapping", str(mapping)]


def test_a_page_shows_all_parts_and_a_recording_without_scans_says_so(bag, tmp_path):
    page = look_page(look(bag))
    for title in ("Where it drove", "Drives that were found", "Command and motion", "told to go"):
        assert title in page
    timeline = json.loads(re.search(r'id="timeline">(.*?)</script>', page)[1])
    assert len(timeline["times"]) == len(timeline["places"]) == len(timeline["people"]) > 50
    assert "http" not in re.sub(r'href="data:[^"]*"', "", page)
    blind = look_page(look(write_bag(tmp_path / "blind", scans=False)))
    assert "No map: the recording holds no scan that can be placed" in blind


def test_a_table_of_people_and_a_bag_without_poses_have_a_page(tmp_path):
    table = tmp_path / "people.csv"
    rows = [f"{a},{n / 10},{0.12 * n},{a}" for a in range(4) for n in range(60)]
    table.write_text("\n".join(["id,t,x,y", *rows]))
    found = look(table)
    assert len(found.drives) == 4
    assert (
        found.enough == "4 drives of 7 m each without actions: only where it went can be learned."
    )
    assert "4 agents" in look_page(found)
    empty = tmp_path / "empty"
    with Writer(empty, version=9) as bag:
        bag.add_connection("/chatter", "std_msgs/msg/String", typestore=STORE)
    page = look_page(look(empty))
    assert "must hold poses of a robot that moves" in page
    assert "Nothing can be learned from it yet" in page
    with pytest.raises(FileError):
        look(tmp_path / "none")


def test_the_command_writes_the_page_and_names_commands_that_work(bag, root, tmp_path, capsys):
    assert run_serd("look", bag, "--output", tmp_path / "page", "--json") == 0
    assert len(json.loads(capsys.readouterr().out)["drives"]) == 2
    assert (tmp_path / "page" / "look.html").read_text().startswith("<!DOCTYPE html>")
    (command,) = look(root / "bags" / "data" / "hallway" / "test").next_commands()
    assert run_serd(*command.split()[1:], "--output", tmp_path / "decisions.csv") == 0
