"""Clocks of senders within one topic, of any type and format: `check` names them, `fix-clock`
corrects their stamps and no other byte."""

import csv
import json

import numpy as np
import pytest
from rosbags.convert import convert
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from serd_bag.command.main import main
from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from serd_bag.topic import MessageType
from serd_bag.verbs.fix_clock import ORIGINALS
from support.bag_messages import POSE, TF, Messages, write_bag

START_S, PATH, GROUP, OWN = 1_700_000_000.0, "nav_msgs/msg/Path", "my/msg/Group", "my/msg/Own"
RULE = "=" * 80
STANDARD = message_type(POSE).text.partition(RULE)
PARTS = f"string label\nstd_msgs/Header header\nbool on\nfloat64 x\n{RULE}{STANDARD[2]}"
GROUP_TEXT = f"uint8 kind\nstring[] names\nfloat64[3] size\nmy/Part[] parts\n{RULE}\nMSG: my/Part\n"
IDL = f"""{RULE}
IDL: my/msg/Own
module my {{ module msg {{ struct Own {{ uint8 kind; std_msgs::msg::Header header; }}; }}; }};
{RULE}
IDL: std_msgs/msg/Header
module std_msgs {{ module msg {{
  struct Header {{ builtin_interfaces::msg::Time stamp; string frame_id; }}; }}; }};
"""
TYPES = {
    "/tf": TF,
    "/plan": PATH,
    "/parts": MessageType(GROUP, GROUP_TEXT + PARTS, ""),
    "/own": MessageType(OWN, IDL, "", "ros2idl"),
}
#: What check says once the clock of an arm, of a planner and of a gripper are wrong.
REMARKS = (
    "/own: stamps are 7.00 s behind log times: the clock of its sender is wrong",
    "/parts (gripper): stamps are 60.00 s ahead of log times: the clock of its sender is wrong",
    "/plan: stamps are 3600.00 s ahead of log times: the clock of its sender is wrong",
    "/tf (arm, hand): stamps are 3600.00 s ahead of log times: the clock of its sender is wrong",
)


@pytest.fixture(scope="module")
def encoder():
    made = Messages()
    made.store.register(get_types_from_msg(GROUP_TEXT + PARTS, GROUP))
    for text in IDL.split(f"{RULE}\nIDL: ")[1:2]:
        made.store.register(get_types_from_idl(text.partition("\n")[2]))
    return made


def written(encoder, path, *, hour=3600.0, gripper=60.0, own=-7.0):
    """A bag of 20 s, received when it was sent; the clocks of some senders are ahead."""
    rows = []
    for time_s in START_S + np.arange(160) / 8:
        where = (1.0, 2.0, 0.5)
        frames = (("odom", "base", 0.0), ("base", "arm", hour), ("arm", "hand", hour))
        sent = encoder.transforms(*((up, at, where, time_s + wrong) for up, at, wrong in frames))
        poses = [{"header": encoder.header(time_s + hour, each)} for each in ("map", "né", "")]
        plan = encoder.filled(PATH, header=encoder.header(time_s + hour), poses=poses)
        parts = [
            {"label": frame, "header": encoder.header(time_s + wrong, frame), "x": 0.5}
            for frame, wrong in (("gripper", gripper), ("lid", 0.0), ("gripper", gripper))
        ]
        group = encoder.filled(GROUP, kind=3, names=["", "ab", "abcd"], parts=parts)
        mine = encoder.filled(OWN, kind=1, header=encoder.header(time_s + own))
        values = zip(TYPES, (sent, plan, group, mine), strict=True)
        rows += [(name, time_s, data) for name, data in values]
    return write_bag(path, TYPES, rows)


def in_format(bag, target):
    """The bag, or what rosbags makes of it; it keeps no definitions in IDL."""
    stores = [get_typestore(store) for store in (Stores.ROS2_JAZZY, Stores.ROS1_NOETIC)]
    if target.suffix == ".bag":
        convert([bag], target, "", 0, None, "none", *stores, ("/own",), (), (), ())
    elif target.suffix == ".db3":
        convert([bag], target, "sqlite3", 9, None, "none", *stores, ("/own",), (), (), ())
    return target if target.exists() else bag


@pytest.mark.parametrize("name", ["bag", "bag.db3", "bag.bag"])
def test_stamps_are_those_of_right_clocks_and_all_else_stays_as_it_was(
    encoder, tmp_path, name, capsys
):
    wrong = in_format(written(encoder, tmp_path / "wrong"), tmp_path / f"wrong_{name}")
    right = written(encoder, tmp_path / "right", hour=0.0, gripper=0.0, own=0.0)
    right = in_format(right, tmp_path / f"right_{name}")
    expected = REMARKS[name != "bag" :]
    assert check_bag(wrong).remarks[: len(expected)] == expected
    assert main(["fix-clock", str(wrong), "-o", str(tmp_path / "fixed")]) == 0
    assert check_bag(tmp_path / "fixed").remarks == ()
    fixed, truth, before = (
        list(BagReader(each).records()) for each in (tmp_path / "fixed", right, wrong)
    )
    assert fixed == truth
    with (tmp_path / "fixed" / ORIGINALS).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 160 * (2 + 4 + 2 + (name == "bag"))
    assert f"{len(rows)} stamps corrected, of " in capsys.readouterr().out
    for row in rows[:: len(rows) // 40]:
        records = [each for each in before if each.channel.topic == row["topic"]]
        data, place = records[int(row["message"])].data, int(row["byte"])
        second, part = np.frombuffer(data[place : place + 8], dtype="<u4")
        assert int(second) * 10**9 + int(part) == int(row["original_ns"])
    assert main(["fix-clock", str(right), "--json"]) == 0
    (values,) = json.loads(capsys.readouterr().out)
    assert values["senders"] == []
    assert not tmp_path.joinpath("right_fixed").exists()


def test_a_sender_that_drifts_and_jumps_is_corrected_to_its_delays(encoder, tmp_path):
    rng, rows = np.random.default_rng(5), []
    for since_s in np.arange(600) / 10:
        time_s = START_S + since_s
        clock_s = time_s + 0.02 * since_s + 5.0 * (since_s >= 30.0)
        where = (1.0, 2.0, 0.5)
        sent = encoder.transforms(("o", "base", where, time_s), ("o", "arm", where, clock_s))
        rows.append(("/tf", time_s + rng.exponential(0.005), sent))
    bag = write_bag(tmp_path / "bag", {"/tf": TF}, rows)
    (remark,) = check_bag(bag).remarks
    jumps, runs = "stamps jump against log times forward by 5.0", "and run ahead of log times by 1."
    assert remark.startswith(f"/tf (arm): {jumps}")
    assert runs in remark
    assert main(["fix-clock", str(bag), "--output", str(tmp_path / "fixed")]) == 0
    assert check_bag(tmp_path / "fixed").remarks == ()
    for _, _, data, *_ in BagReader(tmp_path / "fixed").messages():
        right, fixed = encoder.store.deserialize_cdr(data, TF).transforms
        late_s = fixed.header.stamp.sec - right.header.stamp.sec
        late_s += (fixed.header.stamp.nanosec - right.header.stamp.nanosec) / 1e9
        assert abs(late_s) < 0.05
