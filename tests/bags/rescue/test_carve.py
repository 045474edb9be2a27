"""Recordings are found in any bytes by what stands in them."""

import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_bag.rescue.carve import Part, recordings_in
from serd_bag.rescue.saving import rescue

TEXT = "std_msgs/msg/String"
N_MESSAGES = 120


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """The bytes of one recording of each format, by kind."""
    folder = tmp_path_factory.mktemp("recordings")
    store, rng = get_typestore(Stores.ROS2_JAZZY), np.random.default_rng(1)
    rows = []
    for number in range(N_MESSAGES):
        text = b"%04d" % number + rng.integers(97, 123, 200, dtype=np.uint8).tobytes()
        rows.append((number, b"\0\1\0\0" + (len(text) + 1).to_bytes(4, "little") + text + b"\0"))
    found = {}
    for kind, plugin in (
        (".mcap", rosbag2.StoragePlugin.MCAP),
        (".db3", rosbag2.StoragePlugin.SQLITE3),
    ):
        name = kind.removeprefix(".")
        with rosbag2.Writer(folder / name, version=9, storage_plugin=plugin) as writer:
            topic = writer.add_connection(f"/{name}", TEXT, typestore=store)
            for number, data in rows:
                writer.write(topic, number, data)
        found[kind] = (folder / name / f"{name}{kind}").read_bytes()
    with rosbag1.Writer(folder / "a.bag") as writer:
        writer.chunk_threshold = 4000
        topic = writer.add_connection("/bag", TEXT, typestore=get_typestore(Stores.ROS1_NOETIC))
        for number, data in rows:
            writer.write(topic, number, bytes(store.cdr_to_ros1(data, TEXT)))
    found[".bag"] = (folder / "a.bag").read_bytes()
    return found


def counts_in(bag):
    found = {}
    for record in BagReader(bag).records():
        found[record.channel.topic] = found.get(record.channel.topic, 0) + 1
    return found


def test_several_recordings_in_an_image_become_one_file_each(recordings, tmp_path):
    rng = np.random.default_rng(2)
    parts, image = [], bytearray(rng.bytes(4096))
    for kind, content in recordings.items():
        parts.append(Part(kind, len(image), len(image) + len(content)))
        image += content + bytes(-len(content) % 4096) + rng.bytes(8192)
    path = tmp_path / "disk.img"
    path.write_bytes(image)
    found = recordings_in(path)
    assert [(part.kind, part.start) for part in found] == [part[:2] for part in parts]
    assert found[:2] == parts[:2]
    certificate = rescue(path, tmp_path / "saved")
    assert counts_in(tmp_path / "saved") == dict.fromkeys(("/mcap", "/db3", "/bag"), N_MESSAGES)
    assert len(list((tmp_path / "saved").glob("*.mcap"))) == 3
    spans = certificate.files[0].spans
    assert (spans[0].state, spans[0].end) == ("not ours", 4096)
    assert sum(span.end - span.start for span in spans) == len(image)


@pytest.mark.parametrize("kind", [".mcap", ".db3", ".bag"])
@pytest.mark.parametrize("name", ["part.bin", "named"])
def test_a_recording_without_its_head_is_found(recordings, tmp_path, kind, name):
    content = recordings[kind]
    path = tmp_path / (name if "." in name else f"named{kind}")
    path.write_bytes(bytes(512) + content[512:])
    certificate = rescue(path, tmp_path / "saved")
    # The first messages of an MCAP file stand within those bytes.
    assert certificate.n_messages >= N_MESSAGES - 3 * (kind == ".mcap")
    assert set(counts_in(tmp_path / "saved")) == {f"/{kind.removeprefix('.')}"}


@pytest.mark.parametrize("size", [300, 5000, 30000])
@pytest.mark.parametrize("n_before", [4096, 3 * 512, 700])
def test_long_rows_of_a_database_without_its_head_are_found_in_an_image(tmp_path, size, n_before):
    rng, plugin = np.random.default_rng(3), rosbag2.StoragePlugin.SQLITE3
    rows = [rng.bytes(size) for _ in range(40)]
    with rosbag2.Writer(tmp_path / "db3", version=9, storage_plugin=plugin) as writer:
        store = get_typestore(Stores.ROS2_JAZZY)
        topic = writer.add_connection("/long", TEXT, typestore=store)
        for number, data in enumerate(rows):
            writer.write(topic, number, data)
    content = (tmp_path / "db3" / "db3.db3").read_bytes()[4096:]
    (tmp_path / "disk.img").write_bytes(rng.bytes(n_before) + content + rng.bytes(9000))
    rescue(tmp_path / "disk.img", tmp_path / "saved")
    assert [record.data for record in BagReader(tmp_path / "saved").records()] == rows


def test_all_files_of_a_folder_are_searched_and_one_without_a_recording_is_refused(
    recordings, tmp_path
):
    folder = tmp_path / "stick"
    (folder / "below").mkdir(parents=True)
    (folder / "notes.txt").write_text("nothing")
    (folder / "below" / "a.bag.active").write_bytes(recordings[".bag"])
    (folder / "FSCK0000.REC").write_bytes(recordings[".mcap"])
    assert rescue(folder, tmp_path / "saved").n_messages == 2 * N_MESSAGES
    shutil.rmtree(folder / "below")
    (folder / "FSCK0000.REC").unlink()
    certificate = rescue(folder, tmp_path / "empty")
    assert certificate.n_messages == 0
    assert {span.state for file in certificate.files for span in file.spans} == {"not ours"}
    with pytest.raises(BagError, match="nowhere must be a folder or a"):
        rescue(tmp_path / "nowhere", tmp_path / "none")


def test_rows_of_a_database_that_is_no_recording_are_not_taken_for_messages(tmp_path):
    with closing(sqlite3.connect(tmp_path / "contacts.sqlite")) as database:
        database.execute("CREATE TABLE people(name TEXT)")
        database.executemany("INSERT INTO people VALUES (?)", [(f"name {n}",) for n in range(500)])
        database.commit()
    assert rescue(tmp_path / "contacts.sqlite", tmp_path / "saved").n_messages == 0
