"""sqlite3 bags are compared with their metadata, and salvaged row by row where damaged."""

import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from serd_bag.command.rewrite import convert
from serd_bag.errors import BagError
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import rescue
from support.bag_messages import POSE, VECTOR
from support.damaged_files import write_wrong

N_MESSAGES = 210


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
            for number in range(200):
                long = "map" if number % 9 else "m" * (3000 + 61 * number)
                writer.write(pose, 10 * number, messages.pose(number, 1.0, 2.0, frame=long))
                if number % 20 == 0:
                    writer.write(wish, 10 * number + 1, messages.intent(number, 1.0, 0.0))
        return tmp_path / "old"

    return made


@pytest.fixture
def file(make):
    """A storage file whose metadata.yaml is not used."""
    return make() / "old.db3"


def execute(file, *commands):
    """The rows of the last command."""
    for command in commands:
        with closing(sqlite3.connect(file)) as connection, connection:
            rows = connection.execute(command).fetchall()
    return rows


def contents(path, tolerant=False):
    reader = BagReader(path, tolerant=tolerant)
    return list(reader.messages()), reader


def test_rows_are_read_in_the_order_of_recording_where_log_time_steps_back(file):
    whole, _ = contents(file)
    execute(file, "UPDATE messages SET timestamp = 0 WHERE id > 100")
    times_ns = [message.log_time_ns for message in contents(file)[0]]
    assert times_ns == [each.log_time_ns for each in whole[:100]] + [0] * (len(whole) - 100)


def test_deleted_rows_are_detected_and_counted(file, tmp_path):
    execute(file, "DELETE FROM messages WHERE topic_id = 1 AND id % 2 = 0")
    ((n_left,),) = execute(file, "SELECT count(*) FROM messages")
    with pytest.raises(BagError, match=r"lists 200 messages on /robot_pose, the files hold \d+"):
        contents(file.parent)
    assert not check_bag(file.parent).sound
    report = rescue(file.parent, tmp_path / "new")
    assert (report.n_messages, report.least_lost) == (n_left, N_MESSAGES - n_left)
    assert report.least_lost > 50


def test_a_cut_off_database_gives_the_rows_that_are_whole(file, tmp_path):
    bag = file.parent.rename(tmp_path / "50% of #1, really?")
    whole, _ = contents(bag)
    content = (bag / file.name).read_bytes()
    counts = []
    for size in [*range(40_000, len(content), 60_001), len(content) - 5000]:
        (bag / file.name).write_bytes(content[:size])
        found, reader = contents(bag, tolerant=True)
        assert set(found) <= set(whole)
        assert reader.damage
        assert reader.losses.n_messages == len(whole) - len(found)
        counts.append(len(found))
        with pytest.raises(
            BagError, match=r"the database cannot be read .*save what it holds with"
        ):
            contents(bag)
    assert counts == sorted(counts)
    assert counts[0] > 5
    assert counts[-1] > 0.9 * len(whole)
    assert rescue(bag, tmp_path / "new").n_messages == counts[-1]
    assert contents(tmp_path / "new")[0] == found


def test_wrong_pages_cost_what_they_touch_and_no_byte_makes_the_salvage_fail(file):
    whole, content = contents(file.parent)[0], file.read_bytes()
    rng = np.random.default_rng(8)
    for page in rng.permutation(len(content) // 4096)[:20]:
        write_wrong(file, content, page * 4096, bytes(4096))
        found, reader = contents(file.parent, tolerant=True)
        assert reader.damage or len(found) == len(whole)
        assert len(whole) - len(found) in range(60 if page > 10 else 211)
    leaves = [n + 1 for n in range(1, len(content) // 4096) if content[4096 * n] == 13]
    assert len(leaves) > 20
    for page in leaves[::5]:  # to which a list of unused pages leads
        write_wrong(file, content, 32, page.to_bytes(4, "big"))
        found, reader = contents(file.parent, tolerant=True)
        assert (sorted(found), bool(reader.damage)) == (sorted(whole), True)
    for _ in range(50):
        broken = bytearray(content[:60_000])
        for place in rng.integers(100, len(broken), size=20):
            broken[place] = int(rng.integers(256))
        file.write_bytes(broken)
        found, reader = contents(file.parent, tolerant=True)
        assert reader.damage
        assert len(found) < N_MESSAGES


def test_what_a_killed_recorder_left_in_the_write_ahead_log_is_read(file, tmp_path):
    (tmp_path / "killed").mkdir()
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        with connection:
            row = connection.execute("SELECT topic_id, data FROM messages LIMIT 1").fetchone()
            connection.execute("INSERT INTO messages VALUES (9999, ?, 5000, ?)", row)
        for path in file.parent.glob("*.db3*"):
            shutil.copy(path, tmp_path / "killed")
    assert len(contents(tmp_path / "killed" / file.name)[0]) == N_MESSAGES + 1
    assert (tmp_path / "killed" / f"{file.name}-wal").stat().st_size > 0


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_compressed_file_that_is_cut_off_is_unpacked_as_far_as_it_goes(make, storage, tmp_path):
    bag = make(storage, CompressionMode.FILE)
    whole, _ = contents(bag)
    (file,) = bag.glob("*.zstd")
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 9 // 10])
    with pytest.raises(BagError, match="the compressed file is cut off; save what it holds"):
        contents(bag)
    report = rescue(bag, tmp_path / "new")
    assert report.least_lost == N_MESSAGES - report.n_messages
    (bag / "metadata.yaml").unlink()
    assert set(contents(bag, tolerant=True)[0]) <= set(whole)


def test_messages_packed_one_by_one_that_cannot_be_unpacked_are_counted(make, tmp_path):
    bag = make(mode=CompressionMode.MESSAGE)
    whole, _ = contents(bag)
    change = "UPDATE messages SET data = substr(data, 1, 20) WHERE id IN (5, 7)"
    execute(bag / "old.db3", change)
    with pytest.raises(BagError, match="2 compressed messages cannot be unpacked"):
        contents(bag)
    report = rescue(bag, tmp_path / "new")
    assert (report.n_messages, report.least_lost) == (len(whole) - 2, 2)


def test_check_reports_that_such_files_have_no_checksums(file):
    check = check_bag(file.parent)
    assert check.sound
    assert "changed bytes in it cannot be detected" in check.remarks[-1]
    converted = check_bag(convert(file.parent, file.parent.with_name("new")).target)
    assert not any("checksum" in remark for remark in converted.remarks)


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE message_definitions SET encoding = 'unknown'",
        "UPDATE message_definitions SET encoded_message_definition = CAST(x'ff' AS TEXT)",
        "UPDATE topics SET offered_qos_profiles = 'depth'",
        "UPDATE topics SET offered_qos_profiles = '- {deadline: infinite'",
        "DROP TABLE schema",
    ],
)
def test_a_sound_file_is_read_whatever_describes_its_topics(file, change):
    whole, reader = contents(file.parent)
    execute(file, change)
    found, changed = contents(file.parent)
    assert found == whole
    assert all(each.message_type.text for each in changed.topics.values())
    assert "schema" not in change or changed.topics == reader.topics


#: Lets a column hold no value.
NULLABLE = "UPDATE sqlite_master SET sql = replace(sql, ' NOT NULL', '')"


def test_messages_without_a_topic_are_lost_alone_and_one_of_an_impossible_time_is_kept(
    file, tmp_path
):
    execute(file, "UPDATE messages SET timestamp = -5 WHERE id = 7")
    check = check_bag(file)
    assert check.sound
    assert "1 messages have log times below 0 or after 2^63-1 ns" in check.remarks
    assert rescue(file.parent, tmp_path / "kept").n_messages == N_MESSAGES
    assert 2**64 - 5 in [each.log_time_ns for each in BagReader(tmp_path / "kept").messages()]
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute("PRAGMA writable_schema = 1")
        connection.execute(NULLABLE)
    execute(file, "UPDATE topics SET type = NULL WHERE name = '/intent'")
    check = check_bag(file)
    assert {topic.name: topic.n_messages for topic in check.topics} == {"/robot_pose": 200}
    assert any("10 messages have lost their topic" in fault for fault in check.faults)


def test_a_page_that_hides_rows_is_reported_by_the_index_of_times(file):
    """The root of the messages counts fewer pages than it has, which SQLite does not notice."""
    content = file.read_bytes()
    ((root,),) = execute(file, "SELECT rootpage FROM sqlite_master WHERE name = 'messages'")
    head = 4096 * (root - 1)
    assert content[head] == 5
    write_wrong(file, content, head + 3, (2).to_bytes(2, "big"))
    with pytest.raises(BagError, match=r"its index of times lists 210 messages, \d+ are readable"):
        contents(file)
    assert len(contents(file, tolerant=True)[0]) == N_MESSAGES
