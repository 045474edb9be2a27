"""`cut`, `merge`, `cat`, `diff` and `reindex` copy, print and compare messages as they are."""

import csv
import io
import json
import os
import subprocess
import sys

import pytest

from serd_bag.command.main import main
from serd_bag.errors import BagError
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from serd_bag.verbs.cut import Selection, cut
from serd_bag.verbs.difference import difference
from serd_bag.verbs.reindex import reindex
from support.bag_messages import POSE, write_bag


def records_in(bag):
    return list(BagReader(bag).records())


def test_a_cut_holds_the_messages_of_its_topics_and_times_as_they_are(small_bag, tmp_path):
    bag = small_bag()
    whole = records_in(bag)
    first_ns = whole[0].log_time_ns
    for number, (selection, is_taken) in enumerate(
        [
            (Selection(topics=["/robot.*"]), lambda each: each.channel.topic == "/robot_pose"),
            (Selection(without=["/rob.*"]), lambda each: each.channel.topic == "/intent"),
            (Selection(from_s=1, to_s=2), lambda each: 1 <= (each[3] - first_ns) / 1e9 < 2),
        ]
    ):
        report = cut([bag], tmp_path / f"cut_{number}", selection)
        expected = [each for each in whole if is_taken(each)]
        assert records_in(tmp_path / f"cut_{number}") == expected
        assert 0 < report.n_messages == len(expected) < len(whole)
        assert check_bag(tmp_path / f"cut_{number}").sound


@pytest.mark.parametrize(
    ("selection", "sentence"),
    [
        (Selection(["("]), r"topics must be regular expressions, got '\('"),
        (Selection(["/odom"]), "'/odom' must match a topic, the bag holds /intent, /robot_pose"),
        (Selection(from_s=10.0, to_s=5.0), "--from must be below --to, got 10 and 5"),
    ],
)
def test_a_selection_that_takes_nothing_is_refused(small_bag, tmp_path, selection, sentence):
    with pytest.raises(BagError, match=sentence):
        cut([small_bag()], tmp_path / "new", selection)
    assert not (tmp_path / "new").exists()


def test_merged_bags_are_in_the_order_of_log_times_and_sorting_needs_little_memory(
    tmp_path, messages, monkeypatch
):
    monkeypatch.setattr("serd_bag.verbs.cut._BATCH", 500)
    bags = []
    for number, times_s in enumerate(([5.0, 3.0, 1.0, 7.0], [2.0, 4.0, 6.0])):
        rows = [("/pose", time_s, messages.pose(time_s, number, 0.0)) for time_s in times_s]
        bags.append(write_bag(tmp_path / str(number), {"/pose": POSE}, rows))
    cut(bags, tmp_path / "merged", sort=True)
    found = records_in(tmp_path / "merged")
    assert [each.log_time_ns / 1e9 for each in found] == [1, 2, 3, 4, 5, 6, 7]
    assert sorted(found) == sorted(record for bag in bags for record in records_in(bag))
    cut(bags, tmp_path / "split", split_bytes=300)
    assert len(list((tmp_path / "split").glob("*.mcap"))) > 1


def test_messages_are_printed_as_json_lines_and_csv(small_bag, capsys):
    bag = str(small_bag())
    assert main(["cat", bag, "--topic", "/robot_pose"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    records = [each for each in records_in(bag) if each.channel.topic == "/robot_pose"]
    assert [line["log_time_ns"] for line in lines] == [each.log_time_ns for each in records]
    assert lines[0]["message"]["pose"]["orientation"].keys() == {"x", "y", "z", "w"}
    assert main(["cat", bag, "--columns", "pose.position.x,header.frame_id,none"]) == 0
    rows = list(csv.reader(io.StringIO(capsys.readouterr().out)))
    assert rows[0] == ["topic", "log_time_ns", "pose.position.x", "header.frame_id", "none"]
    poses = [row for row in rows if row[0] == "/robot_pose"]
    assert [float(row[2]) for row in poses] == [each["message"]["pose"]["position"]["x"]
                                                 for each in lines]  # fmt: skip
    assert {row[4] for row in rows[1:]} == {""}


def test_a_difference_names_topic_number_and_time(small_bag, tmp_path, capsys):
    bag = small_bag()
    cut([bag], tmp_path / "same", compression="zstd", sort=True)
    assert main(["diff", str(bag), str(tmp_path / "same")]) == 0
    cut([bag], tmp_path / "less", Selection(to_s=2))
    assert main(["diff", str(bag), str(tmp_path / "less")]) == 1
    assert "2 topics differ" in capsys.readouterr().out
    found = {each.name: each for each in difference(bag, tmp_path / "less")}
    pose = found["/robot_pose"]
    assert (pose.n_same + pose.n_only_first, pose.n_only_second) == (60, 0)
    assert pose.first_s == pytest.approx(2.0, abs=0.1)


def test_a_bag_without_summary_and_metadata_is_indexed_anew_in_place(small_bag):
    bag = small_bag()
    whole, file = records_in(bag), bag / "small_0.mcap"
    (bag / "metadata.yaml").unlink()
    os.truncate(file, file.stat().st_size - 300)
    assert not check_bag(bag).sound
    assert reindex(bag) == len(whole)
    assert check_bag(bag).sound
    assert records_in(bag) == whole
    content = bytearray(file.read_bytes())
    content[len(content) // 3 : len(content) // 2] = bytes(len(content) // 2 - len(content) // 3)
    file.write_bytes(content[:-50])
    with pytest.raises(BagError, match="must have all its messages"):
        reindex(file)
    assert file.read_bytes() == content[:-50]


def test_bags_come_and_go_by_standard_input_and_output(small_bag, tmp_path):
    content = (small_bag() / "small_0.mcap").read_bytes()
    command = [sys.executable, "-m", "serd_bag.command.main", "cut", "-", "--output", "-"]
    done = subprocess.run(
        [*command, "--topic", "/intent"], input=content, capture_output=True, check=True
    )
    (tmp_path / "cut.mcap").write_bytes(done.stdout)
    (topic,) = contents_of_bag(tmp_path / "cut.mcap").topics
    assert (topic.name, topic.n_messages) == ("/intent", 9)


def test_sizes_are_shown_by_topic(small_bag, capsys):
    bag = small_bag()
    assert main(["info", str(bag), "--sizes", "--json"]) == 0
    (values,) = json.loads(capsys.readouterr().out)
    sizes = {topic["name"]: topic["n_bytes"] for topic in values["topics"]}
    records = records_in(bag)
    for name in sizes:
        assert sizes[name] == sum(len(each.data) for each in records if each.channel.topic == name)
