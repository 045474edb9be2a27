"""sqlite3 bags are compared with their metadata, and salvaged row by row where damaged."""

import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from serd_bag.command.rewrite import convert, recover
from serd_bag.errors import BagError
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from support.damaged_files import write_wrong

POSE = "geometry_msgs/msg/PoseStamped"
VECTOR = "geometry_msgs/msg/Vector3Stamped"
N_MESSAGES = 200


@pytest.fixture
def make(tmp_path, messages):
    """Makes a bag of short messages and some that are longer than a page of the database."""

    def made(storage=StoragePlugin.SQLITE3, mode=CompressionMode.NONE):
        store = get_typestore(Stores.ROS2_JAZZY)
        writer = Writer(tmp_path / "old", version=9, storage_plugin=storage)
        writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            pose = writer.add_connection("/robot_pose", POSE, typestore=store)
            wish = writer.add_connection("/intent", VECTOR, typestore=store)
            for number in range(N_MESSAGES):
                long = "map" if number % 9 else "m" * (3000 + 61 * number)
                writer.write(pose, 10 * number, messages.pose(number, 1.0, 2.0, frame=long))
                if number % 20 == 0:
                    writer.write(wish, 10 * number + 1, messages.intent(number, 1.0, 0.0))
        return tmp_path / "old"

    return made


def contents(path, tolerant=False):
    reader = BagReader(path, tolerant=tolerant)
    return list(reader.messages()), reader


def test_rows_are_read_in_the_order_of_recording_where_log_time_steps_back(make):
    bag = make()
    whole, _ = contents(bag)
    file = next(bag.glob("*.db3"))
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE messages SET timestamp = 0 WHERE id > 100")
    connection.close()
    times_ns = [message.log_time_ns for message in contents(file)[0]]
    assert times_ns == [each.log_time_ns for each in whole[:100]] + [0] * (len(whole) - 100)


def test_a_path_may_hold_any_character(make, tmp_path):
    folder = tmp_path / "50% of #1, really?"
    shutil.copytree(make(), folder)
    assert len(contents(folder)[0]) == 210


def test_deleted_rows_are_detected_and_counted(make, tmp_path):
    bag = make()
    with sqlite3.connect(next(bag.glob("*.db3"))) as connection:
        connection.execute("DELETE FROM messages WHERE topic_id = 1 AND id % 2 = 0")
    left = sqlite3.connect(next(bag.glob("*.db3"))).execute("SELECT count(*) FROM messages")
    ((n_left,),) = left.fetchall()
    left.connection.close()
    with pytest.raises(BagError, match=r"lists 200 messages on /robot_pose, the files hold \d+"):
        contents(bag)
    assert not check_bag(bag).sound
    report = recover(bag, tmp_path / "new")
    assert report.n_messages == n_left
    assert report.n_lost == 210 - n_left > 50


def test_a_cut_off_database_gives_the_rows_that_are_whole(make, tmp_path):
    bag = make()
    whole, _ = contents(bag)
    file = next(bag.glob("*.db3"))
    content = file.read_bytes()
    counts = []
    for size in [*range(40_000, len(content), 30_001), len(content) - 5000]:
        file.write_bytes(content[:size])
        found, reader = contents(bag, tolerant=True)
        assert set(found) <= set(whole)
        assert reader.damage
        assert reader.losses.n_messages == len(whole) - len(found)
        counts.append(len(found))
        with pytest.raises(BagError, match=r"the database cannot be read .*repair it with"):
            contents(bag)
    assert counts == sorted(counts)
    assert counts[0] > 5
    assert counts[-1] > 0.9 * len(whole)
    report = recover(bag, tmp_path / "new")
    assert report.n_messages == counts[-1]
    assert contents(tmp_path / "new")[0] == found


def test_a_page_of_zeros_costs_what_it_touches(make):
    bag = make()
    whole, _ = contents(bag)
    file = next(bag.glob("*.db3"))
    content = file.read_bytes()
    rng = np.random.default_rng(8)
    for page in rng.permutation(len(content) // 4096)[:40]:
        write_wrong(file, content, page * 4096, bytes(4096))
        found, reader = contents(bag, tolerant=True)
        assert reader.damage or len(found) == len(whole)
        assert len(found) <= len(whole)
        if page > 10:
            assert len(found) > len(whole) - 60


def test_no_byte_makes_the_salvage_fail(make):
    bag = make()
    file = next(bag.glob("*.db3"))
    content = file.read_bytes()[:60_000]
    rng = np.random.default_rng(9)
    for _ in range(150):
        broken = bytearray(content)
        for place in rng.integers(100, len(content), size=20):
            broken[place] = int(rng.integers(256))
        file.write_bytes(broken)
        found, reader = contents(bag, tolerant=True)
        assert reader.damage
        assert len(found) < N_MESSAGES


def test_what_a_killed_recorder_left_in_the_write_ahead_log_is_read(make, tmp_path):
    bag = make()
    whole, _ = contents(bag)
    file = next(bag.glob("*.db3"))
    killed = tmp_path / "killed"
    killed.mkdir()
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA journal_mode = WAL")
    with connection:
        row = connection.execute("SELECT topic_id, data FROM messages LIMIT 1").fetchone()
        connection.execute("INSERT INTO messages VALUES (9999, ?, 5000, ?)", row)
    for path in bag.glob("*.db3*"):
        shutil.copy(path, killed)
    connection.close()
    found, _ = contents(killed / file.name)
    assert len(found) == len(whole) + 1
    assert (killed / f"{file.name}-wal").stat().st_size > 0


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_compressed_file_that_is_cut_off_is_unpacked_as_far_as_it_goes(make, storage, tmp_path):
    bag = make(storage, CompressionMode.FILE)
    whole, _ = contents(bag)
    assert len(whole) == 210
    file = next(bag.glob("*.zstd"))
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 9 // 10])
    with pytest.raises(BagError, match="the compressed file is cut off; repair it"):
        contents(bag)
    report = recover(bag, tmp_path / "new")
    assert report.n_lost == 210 - report.n_messages
    (bag / "metadata.yaml").unlink()
    assert set(contents(bag, tolerant=True)[0]) <= set(whole)


def test_messages_packed_one_by_one_that_cannot_be_unpacked_are_counted(make, tmp_path):
    bag = make(mode=CompressionMode.MESSAGE)
    whole, _ = contents(bag)
    with sqlite3.connect(next(bag.glob("*.db3"))) as connection:
        connection.execute("UPDATE messages SET data = substr(data, 1, 20) WHERE id IN (5, 7)")
    connection.close()
    with pytest.raises(BagError, match="2 compressed messages cannot be unpacked"):
        contents(bag)
    report = recover(bag, tmp_path / "new")
    assert (report.n_messages, report.n_lost) == (len(whole) - 2, 2)


def test_check_reports_that_such_files_have_no_checksums(make):
    bag = make()
    check = check_bag(bag)
    assert check.sound
    assert "changed bytes in it cannot be detected" in check.remarks[-1]
    converted = check_bag(convert(bag, bag.with_name("new")).target)
    assert not any("checksum" in remark for remark in converted.remarks)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no such table"),
        (bytes(9000), "not a database"),
        (b"SQLite format 3\0" + bytes(9000), "the database"),
    ],
)
def test_a_file_that_is_no_recording_raises(tmp_path, content, message):
    (tmp_path / "file.db3").write_bytes(content)
    with pytest.raises(BagError, match=message):
        contents(tmp_path / "file.db3")
    found, reader = contents(tmp_path / "file.db3", tolerant=True)
    assert found == []
    assert reader.damage


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE message_definitions SET encoding = 'unknown'",
        "UPDATE message_definitions SET encoded_message_definition = CAST(x'ff' AS TEXT)",
        "UPDATE topics SET offered_qos_profiles = 'depth'",
        "UPDATE topics SET offered_qos_profiles = '- history: 1'",
        "UPDATE topics SET offered_qos_profiles = '- {deadline: infinite'",
        "DROP TABLE schema",
    ],
)
def test_a_sound_file_is_read_whatever_describes_its_topics(make, change):
    bag = make()
    whole, reader = contents(bag)
    (file,) = bag.glob("*.db3")
    with closing(sqlite3.connect(file)) as connection:
        connection.execute(change)
        connection.commit()
    found, changed = contents(bag)
    assert found == whole
    if change == "DROP TABLE schema":
        assert changed.topics == reader.topics
        assert all(each.message_type.text for each in changed.topics.values())


def test_a_time_before_zero_costs_its_message_alone(make, tmp_path):
    bag = make()
    with closing(sqlite3.connect(next(bag.glob("*.db3")))) as connection, connection:
        connection.execute("UPDATE messages SET timestamp = -5 WHERE id = 7")
    assert any("1 messages have times outside of" in fault for fault in check_bag(bag).faults)
    n_before = N_MESSAGES + N_MESSAGES // 20
    assert recover(bag, tmp_path / "kept").n_messages == n_before - 1


def _leaves(content):
    """Numbers of the pages that hold rows of tables, from 1."""
    size = len(content) // 4096
    return [page + 1 for page in range(1, size) if content[4096 * page] == 13]


def test_a_list_of_unused_pages_that_leads_to_pages_in_use_hides_no_message(make):
    bag = make()
    whole, _ = contents(bag)
    file = next(bag.glob("*.db3"))
    content = file.read_bytes()
    for page in _leaves(content):
        write_wrong(file, content, 32, page.to_bytes(4, "big"))
        found, reader = contents(bag, tolerant=True)
        assert (sorted(found), bool(reader.damage)) == (sorted(whole), True)
    assert len(_leaves(content)) > 20


def test_a_page_that_hides_rows_is_reported_by_the_index_of_times(make):
    """The root of the messages counts fewer pages than it has, which SQLite does not notice."""
    file = next(make().glob("*.db3"))
    content = file.read_bytes()
    with closing(sqlite3.connect(file)) as connection:
        query = "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"
        ((root,),) = connection.execute(query).fetchall()
    head = 4096 * (root - 1)
    assert content[head] == 5
    write_wrong(file, content, head + 3, (2).to_bytes(2, "big"))
    with pytest.raises(BagError, match=r"its index of times lists 210 messages, \d+ are readable"):
        contents(file)
    assert len(contents(file, tolerant=True)[0]) == 210


def test_a_topic_without_name_or_type_costs_its_messages_alone(make):
    file = next(make().glob("*.db3"))
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("PRAGMA writable_schema = 1")
        connection.execute("UPDATE sqlite_master SET sql = replace(sql, ' NOT NULL', '')")
        connection.commit()
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("UPDATE topics SET type = NULL WHERE name = '/intent'")
        connection.commit()
    check = check_bag(file)
    assert {topic.name: topic.n_messages for topic in check.topics} == {"/robot_pose": 200}
    assert any("10 messages have lost their topic" in fault for fault in check.faults)
